"""Elastic energy of a triangle surface against a reference: membrane and bending, with gradient and
projected Hessian.

The derivatives of single triangles and hinges are written out by hand and vectorised over all of
them. Both energies are free of units: they do not change when the surface is moved, turned or
scaled as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import bsr_array, csc_array

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import edge_neighbors
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index

TURNS = (0, 1, 2)
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
