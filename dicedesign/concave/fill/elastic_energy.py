"""Elastic energy of a triangle surface against a reference: membrane and bending, with gradient and
projected Hessian.

Both energies are free of units: they do not change when the surface is moved, turned or scaled as a
whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import bsr_array, csc_array

from dicedesign.concave.fill.elastic_elements import (
    Elements,
    bending_energy,
    hinge_angles,
    membrane_energy,
    positive_semidefinite,
)
from dicedesign.errors import InputError
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import edge_neighbors
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index

__all__ = ["ElasticEnergy"]


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Blocks of a sparse matrix by rows (starts, indices), and the block of each pair of points of
    every triangle and every hinge."""

    starts: Integers
    indices: Integers
    of_triangles: Integers
    of_hinges: Integers


@dataclass(frozen=True, eq=False)
class ElasticEnergy:
    """`lambda_m E_m + lambda_b E_b` of a surface against a reference (eq. 26).

    E_m is the mean over the reference's area, E_b the sum over its edges.

    Attributes
    ----------
    size: number n of points.
    triangles: (t, 3).
    stiffness: (t, 3, 3) cotangent stiffness of the reference, times `areas`.
    areas: (t,) of the reference, over that of all of it.
    hinges: (e, 4) start and end of each edge between two triangles, the corner to its left and the
        one to its right.
    angles: (e,) of the reference there, in radians.
    hinge_weights: (e,) of squared changes of angle.
    membrane, bending: lambda_m and lambda_b.
    """

    size: int
    triangles: Integers
    stiffness: Floats
    areas: Floats
    hinges: Integers
    angles: Floats
    hinge_weights: Floats
    membrane: float
    bending: float

    @classmethod
    def of(cls, reference: Surface, membrane: float, bending: float) -> ElasticEnergy:
        """The energy against a reference, with lambda_m and lambda_b.

        Edges that two triangles do not share in opposite directions do not bend.

        Raises
        ------
        InputError: a triangle of the reference has no area.
        """
        points, triangles = reference.points, reference.triangles
        corners = points[triangles]
        opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
        normals = np.linalg.cross(opposite[:, 1], opposite[:, 2])
        doubled = norms(normals)
        if not (doubled > 0.0).all():
            raise InputError(
                f"surface: expected triangles with an area, got none in triangle "
                f"{int(np.argmin(doubled))}; remesh it"
            )
        whole = 0.5 * float(doubled.sum())
        # Of a triangle with edges e_i opposite to its corners, K_ij = e_i . e_j / (4 A_0).
        stiffness = opposite @ np.swapaxes(opposite, 1, 2) / (4.0 * whole)
        neighbors = edge_neighbors(triangles)
        left, corner = np.nonzero(neighbors > np.arange(len(triangles))[:, None])
        start, end = triangles[left, (corner + 1) % 3], triangles[left, (corner + 2) % 3]
        right = neighbors[left, corner]
        far = triangles[right].sum(axis=1) - start - end
        hinges = np.stack([start, end, triangles[left, corner], far], axis=1)
        angles = hinge_angles(points[hinges])
        lengths = norms(points[end] - points[start])
        hinge_weights = 6.0 * lengths * lengths / (doubled[left] + doubled[right])
        areas = 0.5 * doubled / whole
        return cls(
            len(points),
            triangles,
            stiffness,
            areas,
            hinges,
            angles,
            hinge_weights,
            membrane,
            bending,
        )

    def _elements(self, points: Floats, with_hessians: bool) -> tuple[Elements, Elements]:
        return (
            membrane_energy(points[self.triangles], self.stiffness, self.areas, with_hessians),
            bending_energy(points[self.hinges], self.angles, self.hinge_weights, with_hessians),
        )

    def terms(self, points: Floats) -> tuple[float, float]:
        """Both weighted energies at points (n, 3); infinite where a triangle is flat."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            membrane, bending = self._elements(points, False)
            stretched = self.membrane * float(membrane.values.sum())
            bent = self.bending * float(bending.values.sum())
        return (
            stretched if np.isfinite(stretched) else np.inf,
            bent if np.isfinite(bent) else np.inf,
        )

    def gradient(self, points: Floats) -> Floats:
        """(n, 3) derivative of the weighted energies at points (n, 3)."""
        return self._sum_of_gradients(*self._elements(points, False))

    def model(self, points: Floats) -> tuple[Floats, csc_array]:
        """Gradient (n, 3) and Hessian (3n, 3n) at points (n, 3), the latter made positive
        semidefinite element by element."""
        membrane, bending = self._elements(points, True)
        assert membrane.hessians is not None
        assert bending.hessians is not None
        pattern = self._pattern
        blocks = np.zeros((len(pattern.indices), 9))
        for weight, hessians, place in (
            (self.membrane, membrane.hessians, pattern.of_triangles),
            (self.bending, bending.hessians, pattern.of_hinges),
        ):
            corners = hessians.shape[1] // 3
            projected = weight * positive_semidefinite(hessians)
            projected = projected.reshape(-1, corners, 3, corners, 3).swapaxes(2, 3).reshape(-1, 9)
            blocks += sums_by_index(place, projected, len(blocks))
        shape = (3 * self.size, 3 * self.size)
        matrix = bsr_array((blocks.reshape(-1, 3, 3), pattern.indices, pattern.starts), shape=shape)
        return self._sum_of_gradients(membrane, bending), csc_array(matrix.tocsc())

    def _sum_of_gradients(self, membrane: Elements, bending: Elements) -> Floats:
        pulls = [self.membrane * membrane.gradients.reshape(-1, 3)]
        pulls.append(self.bending * bending.gradients.reshape(-1, 3))
        places = np.concatenate([self.triangles.ravel(), self.hinges.ravel()])
        return sums_by_index(places, np.concatenate(pulls), self.size)

    @cached_property
    def _pattern(self) -> _Pattern:
        """The blocks of the Hessian that are not 0, and the places of each element's."""
        keys = [
            (element[:, :, None] * self.size + element[:, None, :]).ravel()
            for element in (self.triangles, self.hinges)
        ]
        pairs, places = np.unique(np.concatenate(keys), return_inverse=True)
        rows, columns = np.divmod(pairs, self.size)
        starts = np.searchsorted(rows, np.arange(self.size + 1))
        return _Pattern(starts, columns, places[: len(keys[0])], places[len(keys[0]) :])
