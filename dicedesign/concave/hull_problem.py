"""Design problem of the hull of a surface, elastic space around the surface, and designed hull.

Some sixty vertices, moved smoothly, suffice to design the hull. The surface follows them at full
resolution, by smooth displacements of the surrounding space. The displacement of minimum work for
forces on points is a sum of kernels at these points, in each coordinate. The kernel belongs to the
biharmonic operator in space, so the work is the integral of squared second derivatives. Close parts
of a body therefore move together, such as both sides of an ear, which an energy on the surface
alone would push through each other.

Source: Sibson and Stone, SIAM J. Sci. Stat. Comput. 12(6), 1991 (the kernel |x - y|).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky
from scipy.linalg.lapack import dpotri
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from dicedesign.balance.regions import least_within
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.solvers.descent import graph_laplacian
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index

KERNEL_CONSTANT = 100.0
"""Constant added to the kernel, for a body of circumscribed radius 1: translations cost almost
nothing, and the kernel is positive definite on the body."""

HANDLES = 600
"""Points that stand for all points in forces that move the center of mass."""


def point_masses(surface: Surface) -> Floats:
    """(n,) share of the surface's area at each point, summing to 1."""
    a, b, c = surface.points[surface.triangles].transpose(1, 0, 2)
    areas = norms(np.linalg.cross(b - a, c - a))
    masses = sums_by_index(surface.triangles.ravel(), areas.repeat(3), len(surface.points))
    return masses / masses.sum()


def positive_inverse(matrix: Floats) -> Floats:
    """Inverse of a symmetric positive definite matrix (n, n), in half the time of a general one.

    Raises LinAlgError for another matrix.
    """
    inverse, failed = dpotri(cholesky(matrix, lower=True), lower=1)
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    upper = np.triu_indices(len(matrix), 1)
    inverse[upper] = inverse.T[upper]
    return np.asarray(inverse, dtype=np.float64)


def spread_points(points: Floats, count: int) -> Integers:
    """(count,) indices of points (n, 3), each the farthest from those before; all if there are no
    more."""
    chosen = [0]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        offsets = points - points[chosen[-1]]
        nearest = np.minimum(nearest, (offsets * offsets).sum(-1))
        chosen.append(int(nearest.argmax()))
    return np.array(chosen)


def center_gradient(surface: Surface) -> Floats:
    """(n, 3, 3) gradient of the center of mass of a surface, whose axis is last."""
    return np.moveaxis(surface.centroid_derivatives(), 0, -1)


@dataclass(frozen=True)
class Elasticity:
    """Elastic space around a surface of circumscribed radius about 1."""

    surface: Surface

    def responses(self, points: Integers) -> Floats:
        """(n, c) displacements of all points for a unit force on each of the points (c,)."""
        return KERNEL_CONSTANT - cdist(self.surface.points, self.surface.points[points])

    @cached_property
    def _handles(self) -> tuple[Integers, Integers, Floats]:
        """Points (h,) in which forces on all points are lumped, the handle of each point (n,), and
        the responses (n, h)."""
        points = self.surface.points
        handles = spread_points(points, HANDLES)
        owner = np.asarray(cKDTree(points[handles]).query(points)[1], dtype=np.int64)
        return handles, owner, self.responses(handles)

    def center_responses(self, gradient: Floats) -> Floats:
        """(n, 3, 3) displacements that move the center of mass along each axis, which is last, for
        its gradient (n, 3, 3)."""
        handles, owner, responses = self._handles
        lumped = sums_by_index(owner, gradient.reshape(-1, 9), len(handles))
        return (responses @ lumped).reshape(gradient.shape)


@dataclass(frozen=True)
class HeldCorners:
    """Points of a surface that are moved to given places, and the elastic resistance.

    Attributes
    ----------
    elasticity: elastic space around the surface.
    corners: (c,) indices of the points, distinct.
    """

    elasticity: Elasticity
    corners: Integers

    @cached_property
    def by_corner(self) -> Floats:
        """(n, c) displacements for unit forces on the corners."""
        return self.elasticity.responses(self.corners)

    @cached_property
    def _factor(self) -> tuple[Floats, bool]:
        factor: tuple[Floats, bool] = cho_factor(self.by_corner[self.corners])
        return factor

    def follow(self, displacement: Floats) -> Floats:
        """(n, d) displacements of all points for displacements (c, d) of the corners."""
        return np.asarray(self.by_corner @ cho_solve(self._factor, displacement))

    def hold(self, responses: Floats) -> Floats:
        """(n, d) remaining displacements when the corners are held, for displacements (n, d)."""
        return responses - self.follow(responses[self.corners])

    @cached_property
    def relative(self) -> tuple[Floats, Floats]:
        """Forces (c, 3, c, 3) for displacements of the corners relative to the center of mass, and
        the resulting displacement of the center of mass (c, 3, 3), whose axis is last.

        Raises InputError if nearly all points are corners, as on a convex surface.
        """
        gradient = center_gradient(self.elasticity.surface)
        by_center = self.elasticity.center_responses(gradient)
        own = np.einsum("nab,nac->bc", gradient, by_center)
        own = 0.5 * (own + own.T)
        # Forces on corners are not lumped, so they move the center by the exact gradient.
        mixed = np.tensordot(self.by_corner, gradient, (0, 0))
        compliance = self.by_corner[self.corners][:, None, :, None] * np.eye(3)[None, :, None, :]
        compliance = compliance - mixed[:, :, None, :] - mixed.transpose(2, 0, 1)[None]
        compliance += own[None, :, None, :]
        size = 3 * len(self.corners)
        flat = compliance.reshape(size, size)
        try:
            forces = positive_inverse(0.5 * (flat + flat.T)).reshape(compliance.shape)
        except np.linalg.LinAlgError as error:
            raise InputError(
                f"surface: expected one with dents, but {len(self.corners)} of its "
                f"{len(self.elasticity.surface.points)} points are corners of its hull, and too "
                "little is left to move the center of mass with; take method exact for a convex die"
            ) from error
        return forces, np.tensordot(forces, mixed - own, 2)


CORNERS = 60
"""Number of corners of the hull that is designed, spread over those of the surface. Facets between
corners that are far apart turn little with the errors of a print."""

SAMPLES = 600
"""Points of the surface that represent the points around them."""

CENTER_COMPLIANCE = 3.0
"""Compliance of a center of mass that cavities can move, over the compliance of the whole surface:
larger values make bolder steps."""


@dataclass(frozen=True)
class HullMetric:
    """Cost of displacements of the hull's vertices: `|(tether I + smoothing L) u|^2 / n` with the
    graph Laplacian L of the original hull (the Sobolev metric of section 3.3), plus `elastic` times
    the elastic work and `displaced` times the mean squared displacement of the surface.

    tether, smoothing: positive; elastic, displaced: not negative.
    """

    tether: float
    smoothing: float
    elastic: float
    displaced: float = 0.0


NEAREST = HullMetric(tether=0.1, smoothing=0.2, elastic=0.01, displaced=1.0)
"""Metric that mainly reduces the displacement of the surface."""

UNCROSSED = HullMetric(tether=0.1, smoothing=0.3, elastic=1.0, displaced=0.1)
"""Metric that mainly reduces the elastic work, for surfaces that would intersect themselves."""


@dataclass(frozen=True)
class HullProblem:
    """Surface whose hull is to have target probabilities.

    Attributes
    ----------
    surface: with its center of mass at the origin and circumscribed radius 1.
    target: (k,) target probabilities.
    tolerance: maximum error (`DesignedHull.error`).
    apart: minimum angle between two outcomes, in radians.
    margin: minimum angle of tipping that leaves an outcome, in radians.
    clearance: minimum of `HullDraft.clearance`.
    coarse: whether to design with `CORNERS` of the vertices, or with all.
    room: convex region to which cavities can move the center of mass, around the centroid of the
        uniform solid; None for a solid die.
    """

    surface: Surface
    target: Floats
    tolerance: float
    apart: float = 0.0
    margin: float = 0.0
    clearance: float = 0.0
    coarse: bool = False
    room: ConvexHull | None = None

    def with_room(self, room: ConvexHull) -> HullProblem:
        """Problem with other cavities that shares everything computed from the surface."""
        other = replace(self, room=room)
        vars(other).update({name: value for name, value in vars(self).items() if name != "room"})
        return other

    @cached_property
    def hull(self) -> ConvexHull:
        """Hull of the original surface, or of some of its vertices."""
        return convex_hull(self.surface.points[self._candidates])

    @cached_property
    def source(self) -> Integers:
        """(n,) index of the surface point at each vertex of the hull."""
        return self._candidates[self.hull.source]

    @cached_property
    def whole_hull(self) -> ConvexHull:
        """Hull of the original surface with all vertices."""
        return convex_hull(self.surface.points)

    @cached_property
    def _candidates(self) -> Integers:
        """Indices of the surface points from which the hull is made."""
        hull = self.whole_hull
        if not self.coarse:
            return hull.source
        return hull.source[np.sort(spread_points(hull.vertices, CORNERS))]

    @cached_property
    def elasticity(self) -> Elasticity:
        """Elastic space around the surface."""
        return Elasticity(self.surface)

    @cached_property
    def held(self) -> HeldCorners:
        """Vertices of the hull as points of the surface."""
        return HeldCorners(self.elasticity, self.source)

    @cached_property
    def _sampled_moves(self) -> tuple[Floats, Floats]:
        """Linear map (3 s, 3 n) from displacements of the vertices relative to the center of mass
        to those of samples of the surface, after it is aligned with the original by a similarity,
        each times the square root of its weight; and these roots (s,), of weights that sum to 1."""
        points, forces = self.surface.points, self.held.relative[0]
        samples = spread_points(points, SAMPLES)
        nearest = cKDTree(points[samples]).query(points)[1]
        weights = np.sqrt(np.bincount(nearest, minlength=len(samples)) / len(points))
        by_center = self.elasticity.center_responses(center_gradient(self.surface))[samples]
        moved = np.tensordot(self.held.by_corner[samples], forces, (1, 0))
        moved -= np.tensordot(by_center, forces.sum(axis=0), (2, 0))
        moved *= weights[:, None, None, None]
        flat = moved.reshape(3 * len(samples), -1)
        # Project out translations, rotations and scaling.
        about = points[samples] - (weights**2) @ points[samples]
        axes = np.eye(3)
        moves = [np.broadcast_to(axis, about.shape) for axis in axes]
        moves += [np.cross(axis, about) for axis in axes]
        columns = np.stack([*moves, about], axis=-1) * weights[:, None, None]
        similar = np.linalg.qr(columns.reshape(-1, 7))[0]
        flat -= similar @ (similar.T @ flat)
        return np.asarray(flat), weights

    @cached_property
    def displacement_form(self) -> Floats:
        """(n, 3, n, 3) quadratic form of displacements of the vertices relative to the center of
        mass: the mean squared displacement of all points of the surface, after it is aligned with
        the original by a similarity."""
        flat, forces = self._sampled_moves[0], self.held.relative[0]
        return np.asarray((flat.T @ flat).reshape(forces.shape))

    def shift(self, moved: Floats) -> Floats:
        """(3,) shift of the center of mass by cavities that minimizes the displacement of the
        surface.

        moved: (n, 3) displacement of the vertices relative to the shifted center of mass. Relative
        to the centroid of the uniform solid it is larger by the shift.
        """
        if self.room is None:
            return np.zeros(3)
        slope = np.tensordot(moved, self.displacement_form.sum(axis=2), 2)
        form, room = self.displacement_form.sum(axis=(0, 2)), self.room
        return least_within(form, slope, room.normals, room.heights(np.zeros(3)))

    def displacement(self, moved: Floats) -> float:
        """Root mean squared displacement of the surface over its diagonal, if only the vertices
        determine it, for displacements (n, 3) as in `shift`."""
        moved = moved + self.shift(moved)
        square = np.tensordot(np.tensordot(self.displacement_form, moved, 2), moved, 2)
        return float(np.sqrt(square)) / self.surface.diagonal

    def mean_displacement(self, moved: Floats) -> float:
        """Mean displacement of the surface over its diagonal, otherwise as `displacement`."""
        moved = moved + self.shift(moved)
        flat, roots = self._sampled_moves
        weighted = (flat @ moved.ravel()).reshape(-1, 3)
        return float(roots @ norms(weighted)) / self.surface.diagonal

    @cached_property
    def _compliances(self) -> dict[tuple[HullMetric, bool], Floats]:
        """Compliances by metric, and by whether cavities can move the center of mass."""
        return {}

    def compliance(self, metric: HullMetric) -> Floats:
        """(n, 3, n, 3) displacement of the vertices for forces on them, relative to the center of
        mass, which also yields if cavities can move it."""
        key = metric, self.room is not None
        if key in self._compliances:
            return self._compliances[key]
        count = len(self.hull.vertices)
        laplacian = np.asarray(graph_laplacian(self.hull).toarray(), dtype=np.float64)
        root = metric.tether * np.eye(count) + metric.smoothing * laplacian
        smooth = root @ root / count
        stiffness = metric.elastic * self.held.relative[0]
        for axis in range(3):
            stiffness[:, axis, :, axis] += smooth
        if metric.displaced > 0.0:
            stiffness += metric.displaced * self.displacement_form
        flat = stiffness.reshape(3 * count, 3 * count)
        compliance = positive_inverse(flat).reshape(stiffness.shape)
        if self.room is not None:
            shifting = CENTER_COMPLIANCE * np.linalg.inv(stiffness.sum(axis=(0, 2)))
            compliance = compliance + shifting[None, :, None, :]
        return self._compliances.setdefault(key, compliance)

    def designed(
        self, vertices: Floats, source: Integers, moved: Floats, directions: Floats, error: float
    ) -> DesignedHull:
        """Place a hull where the surface would be if only its vertices determined it.

        vertices: (m, 3) vertices relative to the center of mass; source: (m,) index of each in the
        original hull; moved: see `shift`; directions, error: see `DesignedHull`.
        """
        shift = self.shift(moved)
        center = np.tensordot(moved + shift, self.held.relative[1], 2)
        hull = convex_hull(vertices + (center + shift))
        corners = self.source[source[hull.source]]
        return DesignedHull(hull, corners, center, shift, directions, error, moved)


@dataclass(frozen=True)
class DesignedHull:
    """Hull with the target probabilities.

    Attributes
    ----------
    hull: in the place of the surface; its vertices are moved vertices of the surface's hull, or
        some of them.
    corners: (v,) index of the surface point of each vertex.
    center_of_mass: (3,) required center of mass of the uniform solid.
    shift: (3,) from there to the center of mass with cavities, which gives the probabilities.
    directions: (k, 3) normals of the outcomes' rests.
    error: largest |p - q| over clusters of rests within `SAME_REST_ANGLE`, or the total probability
        of all other rests if that is larger.
    moved: (n, 3) displacement of all vertices of the original hull, relative to the center of mass
        with cavities.
    """

    hull: ConvexHull
    corners: Integers
    center_of_mass: Floats
    shift: Floats
    directions: Floats
    error: float
    moved: Floats
