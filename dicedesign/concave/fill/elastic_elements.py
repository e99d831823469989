"""Elastic energies of single triangles and hinges, with derivatives written out by hand and
vectorised over all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats

__all__ = ["Elements", "bending_energy", "hinge_angles", "membrane_energy", "positive_semidefinite"]

TURNS: Final = (0, 1, 2)
"""The corners of a triangle; corner i + 1 follows corner i."""


@dataclass(frozen=True, eq=False)
class Elements:
    """An energy of each element of k points, with derivatives by their coordinates.

    Attributes
    ----------
    values: (m,).
    gradients: (m, k, 3).
    hessians: (m, 3k, 3k), or None where they were not asked for.
    """

    values: Floats
    gradients: Floats
    hessians: Floats | None


def _cross_matrix(vectors: Floats) -> Floats:
    """(..., 3, 3) matrices M with `M x = v cross x` for vectors v (..., 3)."""
    zero = np.zeros(vectors.shape[:-1])
    x, y, z = np.moveaxis(vectors, -1, 0)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return np.stack(rows, axis=-1).reshape(*vectors.shape, 3)


def _normal_derivatives(corners: Floats) -> tuple[Floats, Floats]:
    """Normals n (m, 3) of triangles (m, 3, 3), of twice their areas, and dn / dx (m, 3, 9)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    opposite = np.stack([c - b, a - c, b - a], axis=1)
    by_corner = np.moveaxis(_cross_matrix(opposite), 1, 2)
    return np.linalg.cross(b - a, c - a), by_corner.reshape(len(corners), 3, 9)


def membrane_energy(
    corners: Floats, stiffness: Floats, weights: Floats, with_hessians: bool = True
) -> Elements:
    """Conformal energy of triangles: `w (x . K x / (2 A) - 1)`, with A the area.

    But for w it is the mean of both ratios of the principal stretches, less 1: zero for every
    similar triangle, infinite for a flat one.

    Parameters
    ----------
    corners: (m, 3, 3) positions.
    stiffness: (m, 3, 3) cotangent stiffness of the reference, w K.
    weights: (m,) w.

    Source: Hormann and Greiner, MIPS: an efficient global parametrization method, Curve and Surface
    Design, 2000.
    """
    normals, turns = _normal_derivatives(corners)
    doubled = norms(normals)
    area = 0.5 * doubled
    unit = normals / doubled[:, None]
    pull = stiffness @ corners
    dirichlet = 0.5 * (corners * pull).sum((1, 2))
    ratio = dirichlet / area
    by_area = 0.5 * np.einsum("mi,mij->mj", unit, turns)
    flat_pull = pull.reshape(-1, 9)
    gradients = (flat_pull - ratio[:, None] * by_area) / area[:, None]
    if not with_hessians:
        return Elements(ratio - weights, gradients.reshape(-1, 3, 3), None)
    across = turns - unit[:, :, None] * (2.0 * by_area)[:, None, :]
    second = 0.5 * np.swapaxes(across, 1, 2) @ across / doubled[:, None, None]
    twist = 0.5 * _cross_matrix(unit)
    second = second.reshape(-1, 3, 3, 3, 3)
    for i in TURNS:
        j = (i + 1) % 3
        second[:, i, :, j] -= twist
        second[:, j, :, i] += twist
    hessians = -ratio[:, None, None] * second.reshape(-1, 9, 9)
    shared = by_area[:, :, None] * gradients[:, None, :]
    hessians -= shared + np.swapaxes(shared, 1, 2)
    blocks = hessians.reshape(-1, 3, 3, 3, 3)
    for axis in range(3):
        blocks[:, :, axis, :, axis] += stiffness
    hessians /= area[:, None, None]
    return Elements(ratio - weights, gradients.reshape(-1, 3, 3), hessians)


def _half_angles(
    start: Floats, end: Floats, apex: Floats, side: float, with_hessians: bool
) -> tuple[Floats, Floats]:
    """Parts of the angle's gradient (m, 3, 3) and Hessian (m, 9, 9), by start, end and apex, that
    come from one triangle beside an edge.

    side: 1 where start, end, apex is its orientation, -1 where it is the other way around.
    """
    corners = np.stack([start, end, apex], axis=1)
    normals, turns = _normal_derivatives(corners)
    normals, turns = side * normals, side * turns
    edge, arm = end - start, apex - start
    length = norms(edge)
    along = edge / length[:, None]
    reach = (arm * along).sum(-1)
    lever = np.stack([length - reach, reach, -length], axis=1)
    squared = (normals * normals).sum(-1)
    inverse = normals / squared[:, None]
    gradients = lever[:, :, None] * inverse[:, None, :]
    if not with_hessians:
        return gradients, np.empty(0)
    tilt = (arm - reach[:, None] * along) / length[:, None]
    none = np.zeros_like(along)
    by_length = np.concatenate([-along, along, none], axis=1)
    by_reach = np.concatenate([-along - tilt, tilt, along], axis=1)
    by_lever = np.stack([by_length - by_reach, by_reach, -by_length], axis=1)
    inner = np.einsum("mi,mij->mj", inverse, turns)
    by_inverse = turns / squared[:, None, None] - 2.0 * inverse[:, :, None] * inner[:, None, :]
    hessians = inverse[:, None, :, None] * by_lever[:, :, None, :]
    hessians += lever[:, :, None, None] * by_inverse[:, None, :, :]
    return gradients, hessians.reshape(-1, 9, 9)


def bending_energy(
    corners: Floats, rest: Floats, weights: Floats, with_hessians: bool = True
) -> Elements:
    """Energy `w (theta - theta_0)^2` of the angles between neighbouring triangles.

    Parameters
    ----------
    corners: (m, 4, 3) start and end of an edge, apex of the triangle to its left and to its right,
        seen from outside.
    rest: (m,) angles theta_0 of the reference in radians, 0 where it is flat, positive at ridges.
    weights: (m,) w.

    Source: Grinspun, Hirani, Desbrun and Schroder, Discrete shells, SCA 2003.
    """
    start, end, left, right = np.moveaxis(corners, 1, 0)
    by_first, twice_first = _half_angles(start, end, left, 1.0, with_hessians)
    by_second, twice_second = _half_angles(start, end, right, -1.0, with_hessians)
    change = np.mod(hinge_angles(corners) - rest + np.pi, 2.0 * np.pi) - np.pi
    slopes = np.zeros((len(corners), 4, 3))
    slopes[:, [0, 1, 2]] += by_first
    slopes[:, [0, 1, 3]] += by_second
    factor = 2.0 * weights * change
    gradients = factor[:, None, None] * slopes
    values = weights * change * change
    if not with_hessians:
        return Elements(values, gradients, None)
    flat = slopes.reshape(-1, 12)
    hessians = (2.0 * weights)[:, None, None] * flat[:, :, None] * flat[:, None, :]
    curves = np.zeros_like(hessians)
    curves[:, :9, :9] += twice_first
    rows = np.r_[0:6, 9:12]
    curves[:, rows[:, None], rows] += twice_second
    hessians += factor[:, None, None] * 0.5 * (curves + np.swapaxes(curves, 1, 2))
    return Elements(values, gradients, hessians)


def hinge_angles(corners: Floats) -> Floats:
    """(m,) angles at the edges of `bending_energy`, in radians."""
    start, end, left, right = np.moveaxis(corners, 1, 0)
    edge = end - start
    first = np.linalg.cross(edge, left - start)
    second = np.linalg.cross(right - start, edge)
    sine = (np.linalg.cross(first, second) * edge).sum(-1) / norms(edge)
    return np.arctan2(sine, (first * second).sum(-1))


def positive_semidefinite(hessians: Floats) -> Floats:
    """The nearest positive semidefinite matrices to Hessians (m, 3k, 3k) of energies of k points
    that do not change when all points are moved alike."""
    count, size = len(hessians), hessians.shape[1] // 3
    basis = np.linalg.qr(np.eye(size) - 1.0 / size)[0][:, : size - 1]
    blocks = hessians.reshape(count, size, 3, size, 3)
    small = np.einsum("ia,minjq,jb->manbq", basis, blocks, basis, optimize=True)
    values, vectors = np.linalg.eigh(small.reshape(count, 3 * size - 3, 3 * size - 3))
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    roots = np.einsum("ia,manr->minr", basis, roots.reshape(count, size - 1, 3, -1), optimize=True)
    roots = roots.reshape(count, 3 * size, -1)
    return roots @ np.swapaxes(roots, 1, 2)
