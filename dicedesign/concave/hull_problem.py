"""A surface whose hull is to have wanted probabilities, the space in which it gives way, and the
hull that has them.

The probabilities are a matter of the whole hull, and so is its design: a few hundred corners that
are moved smoothly do as well as thousands. The surface follows them at its full resolution, by
smooth displacements of the space that it lies in: those of least work that forces on points cause
are sums of kernels about them, each coordinate apart. The kernel is that of the biharmonic operator
in space, so the work is the integral of squared second derivatives: parts of a body that lie near
each other move alike, both sides of an ear or a leg too, which a surface that knows itself only
would push through each other.

Source: Sibson and Stone, SIAM J. Sci. Stat. Comput. 12(6), 1991 (the kernel |x - y|)."""

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

FREE = 100.0
"""The constant that is added to the kernel, for a body of circumscribed radius 1: to move it as a
whole costs next to nothing, and the kernel is positive definite on it."""

HANDLES = 600
"""Points on which forces act that move the center of mass: the true ones, lumped."""


def point_masses(surface: Surface) -> Floats:
    """(n,) part of the surface's area that belongs to each point, summing to 1."""
    a, b, c = surface.points[surface.triangles].transpose(1, 0, 2)
    areas = norms(np.linalg.cross(b - a, c - a))
    masses = sums_by_index(surface.triangles.ravel(), areas.repeat(3), len(surface.points))
    return masses / masses.sum()


def positive_inverse(matrix: Floats) -> Floats:
    """Inverse of a symmetric positive definite matrix (n, n), in half the time of a general one."""
    inverse, failed = dpotri(cholesky(matrix, lower=True), lower=1)
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    upper = np.triu_indices(len(matrix), 1)
    inverse[upper] = inverse.T[upper]
    return np.asarray(inverse, dtype=np.float64)


def spread_points(points: Floats, count: int) -> Integers:
    """(count,) numbers of points (n, 3) that lie as far from each other as can be, one after the
    other; all of them where there are no more."""
    chosen = [0]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        offsets = points - points[chosen[-1]]
        nearest = np.minimum(nearest, (offsets * offsets).sum(-1))
        chosen.append(int(nearest.argmax()))
    return np.array(chosen)


@dataclass(frozen=True)
class Elasticity:
    """The space about a surface.

    Attributes
    ----------
    surface: of circumscribed radius about 1.
    """

    surface: Surface

    def responses(self, points: Integers) -> Floats:
        """(n, c) displacements for a unit force on each of some points (c,)."""
        return FREE - cdist(self.surface.points, self.surface.points[points])

    @cached_property
    def _handles(self) -> tuple[Integers, Integers]:
        """Points on which forces on all are lumped, and the handle of each (n,)."""
        points = self.surface.points
        handles = spread_points(points, HANDLES)
        return handles, np.asarray(cKDTree(points[handles]).query(points)[1], dtype=np.int64)

    @cached_property
    def _by_handle(self) -> Floats:
        return self.responses(self._handles[0])

    def center_responses(self, gradient: Floats) -> Floats:
        """(n, 3, 3) displacements that move the center of mass along each axis, last, for its
        gradient (n, 3, 3)."""
        handles, owner = self._handles
        lumped = sums_by_index(owner, gradient.reshape(-1, 9), len(handles))
        return (self._by_handle @ lumped).reshape(gradient.shape)


@dataclass(frozen=True)
class HeldCorners:
    """Points of the surface that are moved to given places, and what resists it.

    Attributes
    ----------
    elasticity: of the surface.
    corners: (c,) numbers of the points, distinct.
    """

    elasticity: Elasticity
    corners: Integers

    @cached_property
    def by_corner(self) -> Floats:
        """(n, c) displacements for unit forces."""
        return self.elasticity.responses(self.corners)

    @cached_property
    def _factor(self) -> tuple[Floats, bool]:
        factor: tuple[Floats, bool] = cho_factor(self.by_corner[self.corners])
        return factor

    def follow(self, displacement: Floats) -> Floats:
        """(n, d) displacements of all points for those (c, d) of the corners."""
        return np.asarray(self.by_corner @ cho_solve(self._factor, displacement))

    def hold(self, responses: Floats) -> Floats:
        """(n, d) what is left of displacements (n, d) when the corners are held in place."""
        return responses - self.follow(responses[self.corners])

    @cached_property
    def relative(self) -> tuple[Floats, Floats]:
        """Forces for displacements relative to the center of mass, (c, 3, c, 3), and how far that
        goes then, last, (c, 3, 3).

        Raises InputError where nearly all points are corners, as those of a convex surface.
        """
        gradient = np.moveaxis(self.elasticity.surface.centroid_derivatives(), 0, -1)
        by_center = self.elasticity.center_responses(gradient)
        own = np.einsum("nab,nac->bc", gradient, by_center)
        own = 0.5 * (own + own.T)
        # The true gradient tells how far forces on corners move the center.
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


SPREAD = 60
"""Corners that are taken first, as far from each other as can be."""

MOST_CORNERS = 300
"""Corners beyond which none is added."""

CLOSE = 1e-3
"""Distance of the corners that are left out from the hull of the others, over the circumscribed
radius, at which it is near enough."""


def coarse_corners(hull: ConvexHull) -> Integers:
    """The rising numbers (c,) of corners of a hull whose own hull is near to it.

    hull: of circumscribed radius about 1. Those that stick out farthest from the hull of the others
    are taken in turn, one above each facet at a time.
    """
    corners = hull.vertices
    if len(corners) <= SPREAD:
        return np.arange(len(corners))
    chosen = spread_points(corners, SPREAD)
    while True:
        coarse = convex_hull(corners[chosen])
        middle = coarse.vertices.mean(axis=0)
        above = (corners - middle) @ coarse.normals.T - coarse.heights(middle)
        facet = above.argmax(axis=1)
        height = above[np.arange(len(corners)), facet]
        height[chosen] = 0.0
        # Of those above each facet the highest, the highest of all first.
        order = np.argsort(-height, kind="stable")
        order = order[height[order] > CLOSE]
        first = np.sort(np.unique(facet[order], return_index=True)[1])
        farthest = order[first][: MOST_CORNERS - len(chosen)]
        if len(farthest) == 0:
            return np.sort(chosen)
        chosen = np.concatenate([chosen, farthest])


SAMPLES = 600
"""Points of the surface that stand for those around them."""


def displacement_form(held: HeldCorners, forces: Floats) -> Floats:
    """(c, 3, c, 3) the quadratic form that is the mean squared displacement of the points of a
    surface, laid onto the original as well as a similarity can, for displacements of some of them.

    Parameters
    ----------
    held: those points, the corners.
    forces: (c, 3, c, 3) on them, for displacements relative to the center of mass, on which they
        act back (`HeldCorners.relative`).
    """
    points = held.elasticity.surface.points
    samples = spread_points(points, SAMPLES)
    nearest = cKDTree(points[samples]).query(points)[1]
    weights = np.sqrt(np.bincount(nearest, minlength=len(samples)) / len(points))
    gradient = np.moveaxis(held.elasticity.surface.centroid_derivatives(), 0, -1)
    by_center = held.elasticity.center_responses(gradient)[samples]
    moved = np.tensordot(held.by_corner[samples], forces, (1, 0))
    moved -= np.tensordot(by_center, forces.sum(axis=0), (2, 0))
    moved *= weights[:, None, None, None]
    flat = moved.reshape(3 * len(samples), -1)
    # Orthonormal displacements by which they are shifted, turned and scaled.
    about = points[samples] - (weights**2) @ points[samples]
    axes = np.eye(3)
    moves = [np.broadcast_to(axis, about.shape) for axis in axes]
    moves += [np.cross(axis, about) for axis in axes]
    columns = np.stack([*moves, about], axis=-1) * weights[:, None, None]
    similar = np.linalg.qr(columns.reshape(-1, 7))[0]
    flat -= similar @ (similar.T @ flat)
    return np.asarray((flat.T @ flat).reshape(forces.shape))


GIVING = 3.0
"""How far a center of mass gives way that cavities can shift, over how far the surface does when it
is displaced as a whole: the more, the bolder are the steps with it."""


@dataclass(frozen=True)
class HullMetric:
    """The cost of displacements of corners: `|(tether I + smoothing L) u|^2 / n`, with the graph
    Laplacian L of the original hull (the Sobolev metric of section 3.3), `elastic` times the work
    that the surface takes, and `displaced` times its mean squared displacement.

    Attributes
    ----------
    tether, smoothing: positive.
    elastic, displaced: not negative.
    """

    tether: float
    smoothing: float
    elastic: float
    displaced: float = 0.0


@dataclass(frozen=True)
class HullProblem:
    """A surface whose hull is to have wanted probabilities.

    Attributes
    ----------
    surface: its center of mass at the origin, its circumscribed radius 1.
    target: (k,) the probabilities.
    tolerance: largest error (`DesignedHull.error`) that will do.
    apart: least angle between two outcomes that will do, in radians.
    margin: least angle of tipping that leaves an outcome that will do, in radians.
    coarse: whether some of the corners will do (`coarse_corners`), or all are designed with.
    room: where cavities can bring the center of mass, relative to that of the uniform solid, which
        is inside; None for a solid die.
    """

    surface: Surface
    target: Floats
    tolerance: float
    apart: float = 0.0
    margin: float = 0.0
    coarse: bool = False
    room: ConvexHull | None = None

    def with_room(self, room: ConvexHull) -> HullProblem:
        """Problem with other cavities; everything computed from the surface is shared."""
        other = replace(self, room=room)
        vars(other).update({name: value for name, value in vars(self).items() if name != "room"})
        return other

    @cached_property
    def hull(self) -> ConvexHull:
        """Hull of the original surface, or of enough of its corners."""
        return convex_hull(self.surface.points[self._candidates])

    @cached_property
    def source(self) -> Integers:
        """(n,) number of the surface's point of each corner."""
        return self._candidates[self.hull.source]

    @cached_property
    def whole_hull(self) -> ConvexHull:
        """Hull of the original surface, with all corners."""
        return convex_hull(self.surface.points)

    @cached_property
    def _candidates(self) -> Integers:
        """Points of the surface that its hull is made of."""
        hull = self.whole_hull
        return hull.source[coarse_corners(hull)] if self.coarse else hull.source

    @cached_property
    def elasticity(self) -> Elasticity:
        """Elastic energy of the surface."""
        return Elasticity(self.surface)

    @cached_property
    def held(self) -> HeldCorners:
        """The corners as points of the surface."""
        return HeldCorners(self.elasticity, self.source)

    @cached_property
    def displacement_form(self) -> Floats:
        """(n, 3, n, 3) see `displacement_form`, for displacements of the corners."""
        return displacement_form(self.held, self.held.relative[0])

    def shift(self, moved: Floats) -> Floats:
        """(3,) from the center of mass of the uniform solid to where cavities are to bring it, so
        that the surface is displaced least.

        moved: (n, 3) displacement of the corners relative to the center of mass, whichever it is.
        That relative to the solid's own is larger by the shift.
        """
        if self.room is None:
            return np.zeros(3)
        slope = np.tensordot(moved, self.displacement_form.sum(axis=2), 2)
        form, room = self.displacement_form.sum(axis=(0, 2)), self.room
        return least_within(form, slope, room.normals, room.heights(np.zeros(3)))

    def displacement(self, moved: Floats) -> float:
        """Root of the mean squared displacement of the surface, over its diagonal, when it is led
        by the corners alone, moved by (n, 3) as in `shift`."""
        moved = moved + self.shift(moved)
        square = np.tensordot(np.tensordot(self.displacement_form, moved, 2), moved, 2)
        return float(np.sqrt(square)) / self.surface.diagonal

    @cached_property
    def _compliances(self) -> dict[tuple[HullMetric, bool], Floats]:
        """Compliances by metric, and by whether the center of mass is free."""
        return {}

    def compliance(self, metric: HullMetric) -> Floats:
        """(n, 3, n, 3) displacement of the hull's corners for forces on them, relative to the
        center of mass, which gives way too where cavities can bring it elsewhere."""
        key = metric, self.room is not None
        if key not in self._compliances:
            self._compliances[key] = self._compliance(metric)
        return self._compliances[key]

    def designed(
        self, vertices: Floats, source: Integers, moved: Floats, directions: Floats, error: float
    ) -> DesignedHull:
        """A hull where the surface would be led by its corners alone.

        vertices: (m, 3) of it, relative to the center of mass; source: (m,) corner of the original
        hull that each of them was; moved: see `shift`; directions, error: see `DesignedHull`.
        """
        shift = self.shift(moved)
        center = np.tensordot(moved + shift, self.held.relative[1], 2)
        hull = convex_hull(vertices + (center + shift))
        corners = self.source[source[hull.source]]
        return DesignedHull(hull, corners, center, shift, directions, error, moved)

    def _compliance(self, metric: HullMetric) -> Floats:
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
        compliance = positive_inverse(flat).reshape(count, 3, count, 3)
        if self.room is not None:
            shifting = GIVING * np.linalg.inv(stiffness.sum(axis=(0, 2)))
            compliance = compliance + shifting[None, :, None, :]
        return compliance


@dataclass(frozen=True)
class DesignedHull:
    """A hull with the wanted probabilities.

    Attributes
    ----------
    hull: in the place of the surface; its corners are those of the surface's hull, moved, or some
        of them.
    corners: (v,) number of the surface's point of each corner.
    center_of_mass: (3,) that of the uniform solid that is to fill it.
    shift: (3,) from there to the place for which its probabilities are the wanted ones.
    directions: (k, 3) normals of the outcomes' rests.
    error: largest of |p - q| over clusters of rests within `SAME_REST_ANGLE` of those, and the
        probabilities of all other rests together.
    moved: (n, 3) displacement of all corners of the original hull, relative to that place.
    """

    hull: ConvexHull
    corners: Integers
    center_of_mass: Floats
    shift: Floats
    directions: Floats
    error: float
    moved: Floats
