"""Elastic energy of a triangle surface relative to a reference: membrane and bending, with gradient
and projected Hessian.

Both energies have no unit: they do not change when the surface is moved, rotated or scaled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from scipy.sparse import coo_array, csc_array
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface, edge_neighbors
from dicedesign.runtime.arrays import Floats, Integers


@dataclass(frozen=True, eq=False)
class ElasticEnergy:
    """`lambda_m E_m + lambda_b E_b` of a surface relative to a reference (eq. 26).

    E_m is the mean over the reference's area, E_b the sum over its edges.

    Attributes
    ----------
    triangles: (t, 3).
    stiffness: (t, 3, 3) cotangent stiffness of the reference, times `areas`.
    areas: (t,) areas of the reference over their sum, times lambda_m.
    hinges: (e, 4) start and end of each edge between two triangles, and the corners to its left and
        right, seen from outside.
    angles: (e,) angles of the reference at the hinges, in radians.
    hinge_weights: (e,) weights of squared changes of the angles, times lambda_b.
    """

    triangles: Integers
    stiffness: Tensor
    areas: Tensor
    hinges: Integers
    angles: Tensor
    hinge_weights: Tensor

    @classmethod
    def of(cls, reference: Surface, membrane: float, bending: float) -> ElasticEnergy:
        """Energy relative to a reference, with lambda_m and lambda_b.

        Edges without two oppositely oriented triangles do not bend. Raises InputError if a triangle
        of the reference has no area.
        """
        points, triangles = reference.points, reference.triangles
        corners = points[triangles]
        opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
        doubled = norms(np.linalg.cross(opposite[:, 1], opposite[:, 2]))
        if not (doubled > 0.0).all():
            raise InputError(
                f"surface: expected triangles with an area, got none in triangle "
                f"{int(np.argmin(doubled))}; remesh it"
            )
        # K_ij = e_i . e_j / (4 A_0) for the edges e_i opposite to the corners.
        stiffness = opposite @ np.swapaxes(opposite, 1, 2) / (2.0 * doubled.sum())
        neighbors = edge_neighbors(triangles)
        left, corner = np.nonzero(neighbors > np.arange(len(triangles))[:, None])
        start, end = triangles[left, (corner + 1) % 3], triangles[left, (corner + 2) % 3]
        right = neighbors[left, corner]
        far = triangles[right].sum(axis=1) - start - end
        hinges = np.stack([start, end, triangles[left, corner], far], axis=1)
        squared = ((points[end] - points[start]) ** 2).sum(-1)
        return cls(
            triangles,
            torch.from_numpy(membrane * stiffness),
            torch.from_numpy(membrane * doubled / doubled.sum()),
            hinges,
            hinge_angles(torch.from_numpy(points[hinges])),
            torch.from_numpy(bending * 6.0 * squared / (doubled[left] + doubled[right])),
        )

    def membranes(self, corners: Tensor) -> Tensor:
        """(t,) conformal energies `w (x . K x / (2 A) - 1)` of triangles with corners (t, 3, 3).

        Without w, it is the mean of the two ratios of the principal stretches, minus 1: zero for
        similar triangles, infinite for flat ones.

        Source: Hormann and Greiner, MIPS: an efficient global parametrization method, Curve and
        Surface Design, 2000.
        """
        a, b, c = corners.unbind(1)
        doubled = torch.linalg.vector_norm(torch.linalg.cross(b - a, c - a), dim=1)
        return (corners * (self.stiffness @ corners)).sum((1, 2)) / doubled - self.areas

    def bends(self, corners: Tensor) -> Tensor:
        """(e,) energies `w (theta - theta_0)^2` of hinges with corners (e, 4, 3).

        Source: Grinspun, Hirani, Desbrun and Schroder, Discrete shells, SCA 2003.
        """
        change = hinge_angles(corners) - self.angles
        change = torch.remainder(change + math.pi, 2.0 * math.pi) - math.pi
        return self.hinge_weights * change**2

    def value(self, points: Floats) -> float:
        """Energy at points (n, 3); infinite if a triangle is flat."""
        energy = float(self._value(torch.from_numpy(points)))
        return energy if math.isfinite(energy) else math.inf

    def gradient(self, points: Floats) -> Floats:
        """(n, 3) gradient at points (n, 3)."""
        variables = torch.tensor(points, requires_grad=True)
        return np.asarray(torch.autograd.grad(self._value(variables), variables)[0])

    def hessian(self, points: Floats) -> csc_array:
        """(3 n, 3 n) Hessian at points (n, 3), with each element projected to a positive
        semidefinite one."""
        total = csc_array((points.size, points.size))
        for elements, energy in ((self.triangles, self.membranes), (self.hinges, self.bends)):
            corners = torch.tensor(points[elements], requires_grad=True)
            (slopes,) = torch.autograd.grad(energy(corners).sum(), corners, create_graph=True)
            # The elements are independent: each pass gives one row of the Hessians of all.
            rows = [
                torch.autograd.grad(slope, corners, retain_graph=True)[0].flatten(1)
                for slope in slopes.sum(0).flatten()
            ]
            hessians = positive_semidefinite(torch.stack(rows, dim=1).numpy())
            places = (3 * elements[:, :, None] + np.arange(3)).reshape(len(elements), -1)
            row, column = np.broadcast_arrays(places[:, :, None], places[:, None, :])
            entries = (hessians.ravel(), (row.ravel(), column.ravel()))
            total += coo_array(entries, shape=total.shape).tocsc()
        return total

    def _value(self, points: Tensor) -> Tensor:
        membranes, bends = self.membranes(points[self.triangles]), self.bends(points[self.hinges])
        return membranes.sum() + bends.sum()


def hinge_angles(corners: Tensor) -> Tensor:
    """(e,) angles in radians between the triangles of hinges (e, 4, 3): 0 if flat, positive at
    ridges."""
    start, end, left, right = corners.unbind(1)
    edge = end - start
    first = torch.linalg.cross(edge, left - start)
    second = torch.linalg.cross(right - start, edge)
    length = torch.linalg.vector_norm(edge, dim=1)
    sine = (torch.linalg.cross(first, second) * edge).sum(-1) / length
    return torch.atan2(sine, (first * second).sum(-1))


def positive_semidefinite(hessians: Floats) -> Floats:
    """Nearest positive semidefinite matrices to Hessians (m, 3 k, 3 k) of energies of k points that
    are invariant under translations."""
    size = hessians.shape[1] // 3
    # Without translations the matrices are smaller.
    shapes = np.linalg.qr(np.eye(size) - 1.0 / size)[0][:, : size - 1]
    basis = np.kron(shapes, np.eye(3))
    values, vectors = np.linalg.eigh(basis.T @ hessians @ basis)
    roots = basis @ (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :])
    return np.asarray(roots @ np.swapaxes(roots, 1, 2))
