"""The body that is looked at, how dragging changes it, and a thinned mesh to draw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import angle_between
from dicedesign.geometry.triangles import solid_properties
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import MomentumModel
from dicedesign.throws.momentum_probabilities import momentum_probabilities
from dicedesign.throws.rigid_body import RigidBody, rigid_body

CLEARANCE: Final = 1e-3
"""Part of the way from the centroid to the surface at which a center stays."""


def nearest_inside(hull: ConvexHull, point: Floats) -> tuple[Floats, bool]:
    """A point (3,), or the last one within a hull on the straight way to it from the hull's
    centroid, a little below the surface; and whether the point was inside.

    Raises InputError: the point is not three finite numbers.
    """
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError(
            f"center of mass: expected three finite numbers, got {point.tolist()}; type numbers"
        )
    depths = hull.heights(hull.centroid)
    # How much of each facet's depth the way uses up.
    used = 1.0 - hull.heights(point) / depths
    most = float(used.max())
    if most <= 1.0 - CLEARANCE:
        return point, True
    way = (1.0 - CLEARANCE) / most
    return hull.centroid + way * (point - hull.centroid), False


MOST_SHOWN: Final = 150_000
"""Triangles that a browser draws at once; a mesh of more is thinned."""

MOST_POINTS: Final = 1_000_000
"""Of a mesh whose whole hull is looked at; of one with more, that of its farthest points."""

WAYS: Final = 64
"""Cells along each side of the cube in which directions are told apart: 24,576 in all."""

FINEST: Final = 256

COARSEST: Final = 16


def thinned(points: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """A mesh of at most `MOST_SHOWN` triangles: points (n, 3) in one cell of a grid become one.

    The grid is as fine as allows; a mesh that is small enough is returned as it is. Source:
    Rossignac and Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993.
    """
    if len(triangles) <= MOST_SHOWN:
        return points, triangles
    lowest = points.min(axis=0)
    extent = float(np.ptp(points, axis=0).max())
    cells = FINEST
    while True:
        place = np.minimum((points - lowest) * (cells / extent), cells - 1).astype(np.int64)
        keys = (place[:, 0] * cells + place[:, 1]) * cells + place[:, 2]
        known, group, sizes = np.unique(keys, return_inverse=True, return_counts=True)
        corners = group[triangles]
        whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
        kept = np.unique(_from_least(corners[whole]), axis=0)
        if len(kept) <= MOST_SHOWN or cells <= COARSEST:
            break
        # Triangles are as many as cells that the surface passes through.
        cells = max(COARSEST, int(cells * 0.95 * np.sqrt(MOST_SHOWN / len(kept))))
    sums = [np.bincount(group, points[:, axis], len(known)) for axis in range(3)]
    return np.stack(sums, axis=1) / sizes[:, None], kept


def farthest_points(points: Floats) -> Floats:
    """(m, 3) of points (n, 3), the one that is farthest from their middle in each of `WAYS`
    directions: the hull of these is a little within that of all."""
    arms = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    along = np.abs(arms).argmax(axis=1)
    rows = np.arange(len(arms))
    longest = arms[rows, along]
    kept = longest != 0.0
    cell = 2 * along + (longest > 0.0)
    for turn in (1, 2):
        part = arms[rows, (along + turn) % 3] / np.where(kept, np.abs(longest), 1.0)
        cell = cell * WAYS + np.minimum((0.5 + 0.5 * part) * WAYS, WAYS - 1).astype(np.int64)
    distance = (arms * arms).sum(axis=1)
    order = np.lexsort((distance, cell))
    last = np.append(cell[order[1:]] != cell[order[:-1]], True)
    return points[np.sort(order[last])]


def _from_least(corners: Integers) -> Integers:
    """Triangles (t, 3) turned so that each begins with its least corner."""
    first = corners.argmin(axis=1)
    return np.take_along_axis(corners, (first[:, None] + np.arange(3)) % 3, axis=1)


SAME_REST: Final = np.radians(20.0)
"""A rest whose facet turned by less from one move to the next keeps its number."""

SEEN: Final = 1e-5
"""Part of a hull's volume that is too little to be seen."""

ELSEWHERE: Final = "other"
"""The row of rests that show no outcome."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What a die shows.

    Attributes
    ----------
    labels: of the k outcomes.
    directions: (k, 3) unit, in the body's frame, down when the die shows them.
    target: (k,) wanted probabilities, or None.
    prior: under which the probabilities are, when it is set down; None where any side is down
        alike.
    """

    labels: tuple[str, ...]
    directions: Floats
    target: Floats | None = None
    prior: Prior | str | None = None


@dataclass(frozen=True)
class Row:
    """One row of bars.

    Attributes
    ----------
    label: of the outcome, or the number of the rest.
    color: number of its color, which it keeps while the body is dragged.
    rest: in `poses`, the one that it stands on when asked to; -1 where it has none.
    probabilities: set down; wanted: None where nothing is.
    """

    label: str
    color: int
    rest: int
    probabilities: float
    wanted: float | None = None


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape whose center of mass may be anywhere.

    Attributes
    ----------
    body: the mesh that was read, or the hull that was dragged.
    poses: with some center of mass.
    """

    body: Body
    poses: RestPoses

    @cached_property
    def is_convex(self) -> bool:
        """Whether nothing of the hull is missing in the mesh that one could see."""
        if self.body.triangles is None:
            return False
        hull = self.poses.hull
        filled = abs(solid_properties(self.body.points, self.body.triangles)[0])
        whole = solid_properties(hull.vertices, hull.triangles)[0]
        return filled >= (1.0 - SEEN) * whole

    @cached_property
    def inertia(self) -> Floats:
        """(3, 3) tensor of inertia over the mass about the centroid of the uniform solid."""
        return rigid_body(self.body, self.poses).inertia


@dataclass(frozen=True, eq=False)
class ViewedBody:
    """A body as it is now.

    Attributes
    ----------
    name: what the page calls it.
    solid: its shape.
    poses: its rests.
    outcomes: of a die, or None.
    numbers: (r,) from 0, of the rests; they keep them while the body is dragged.
    follows: the center of mass is that of the uniform solid hull, whatever shape that takes.
    dragged: the hull is no longer that of the mesh.
    """

    name: str
    solid: Solid
    poses: RestPoses
    outcomes: Outcomes | None
    numbers: Integers
    follows: bool
    dragged: bool = False

    @classmethod
    def of(
        cls,
        body: Body,
        center_of_mass: Floats | str | None = None,
        outcomes: Outcomes | None = None,
        *,
        name: str | None = None,
        poses: RestPoses | None = None,
    ) -> ViewedBody:
        """A body as it was read. Raises as `rest_poses`.

        center_of_mass: as of `rest_poses`; poses: those with it, where they are known.
        """
        if poses is None:
            poses = rest_poses(body, center_of_mass)
        if outcomes is not None:
            poses = poses.under(outcomes.prior)
        source = poses.center_of_mass_source
        apart = np.abs(poses.center_of_mass - poses.hull.centroid).max()
        extent = float(np.ptp(poses.hull.vertices, axis=0).max())
        follows = source == "uniform solid hull" or (
            source == "uniform solid" and bool(apart <= 1e-6 * extent)
        )
        numbers = np.arange(len(poses.facets))
        return cls(name or body.name, Solid(body, poses), poses, outcomes, numbers, follows)

    @property
    def hull(self) -> ConvexHull:
        """The hull as it is now."""
        return self.poses.hull

    @property
    def center(self) -> Floats:
        """(3,) center of mass, in the body's unit."""
        return self.poses.center_of_mass

    @cached_property
    def _outcome_probabilities(self) -> OutcomeProbabilities:
        assert self.outcomes is not None
        return outcome_probabilities(self.poses, self.outcomes.directions)

    @cached_property
    def row_of_rest(self) -> Integers:
        """(r,) place in `rows` of each rest."""
        if self.outcomes is None:
            return np.argsort(np.argsort(self.numbers, kind="stable"))
        of_rest = self._outcome_probabilities.outcome_of_rest
        return np.where(of_rest >= 0, of_rest, len(self.outcomes.labels))

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """A row for each outcome of a die, and one for what shows none; or for each rest, by
        number."""
        probabilities = self.poses.probabilities
        if self.outcomes is None:
            return tuple(
                Row(str(number + 1), number, rest, float(probabilities[rest]))
                for number, rest in sorted((n, r) for r, n in enumerate(self.numbers.tolist()))
            )
        known, target = self._outcome_probabilities, self.outcomes.target
        rows = [
            Row(label, k, int(known.main[k]), float(known.probabilities[k]), _wanted(target, k))
            for k, label in enumerate(self.outcomes.labels)
        ]
        stray = np.flatnonzero(known.outcome_of_rest < 0)
        if len(stray):
            rows.append(Row(ELSEWHERE, len(rows), int(stray[0]), known.elsewhere))
        return tuple(rows)

    def by_row(self, of_rests: Floats) -> Floats:
        """Sums (rows,) of numbers of rests (r,)."""
        return np.bincount(self.row_of_rest, of_rests, len(self.rows)).astype(np.float64)

    @cached_property
    def rigid(self) -> RigidBody:
        """To throw. With the inertia of the uniform solid, wherever the center of mass is."""
        return rigid_body(self.solid.body, self.poses, self.solid.inertia)

    def thrown(self, model: MomentumModel | None) -> Floats:
        """(rows,) probabilities of the body thrown onto a table, by its momentum model."""
        alike = self.poses.under(None)
        of_facet = np.zeros(len(self.hull.normals))
        of_facet[alike.facets] = momentum_probabilities(alike, self.rigid, model)
        return self.by_row(of_facet[self.poses.facets])

    def with_center(self, point: Floats) -> tuple[ViewedBody, bool]:
        """The body with its center of mass at a point (3,), or where the way there leaves the hull;
        and whether it does. Raises InputError: it is not three finite numbers."""
        center, inside = nearest_inside(self.hull, np.asarray(point, dtype=np.float64))
        return self._analyzed(self.hull, center, "given", follows=False), not inside

    def with_uniform_center(self) -> ViewedBody:
        """The body with the center of mass of its uniform solid hull, which it keeps to from now
        on."""
        return self._analyzed(self.hull, self.hull.centroid, "uniform solid hull", follows=True)

    def with_vertex(self, vertex: int, place: Floats) -> ViewedBody:
        """The body with a vertex of its hull at a place (3,). Raises DegenerateBodyError."""
        points = self.hull.vertices.copy()
        points[vertex] = place
        return self.with_hull(points)

    def with_facet(self, facet: int, motion: Floats) -> ViewedBody:
        """The body with the corners of a facet of its hull carried by a motion (4, 4). Raises
        DegenerateBodyError."""
        hull = self.hull
        corners = hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]
        points = hull.vertices.copy()
        points[corners] = points[corners] @ motion[:3, :3].T + motion[:3, 3]
        return self.with_hull(points)

    def with_hull(self, points: Floats) -> ViewedBody:
        """The body whose solid is the hull of points (n, 3). Its center of mass stays where it is,
        unless it follows the shape or would be outside. Raises DegenerateBodyError."""
        if not np.isfinite(points).all():
            raise InputError("hull: expected finite coordinates, got others; drag less far")
        hull = convex_hull(points)
        center = hull.centroid if self.follows else nearest_inside(hull, self.center)[0]
        source = "uniform solid hull" if self.follows else "given"
        moved = self._analyzed(hull, center, source, follows=self.follows)
        body = Body(hull.vertices, hull.triangles, self.solid.body.name, False, ())
        return replace(moved, solid=Solid(body, moved.poses), dragged=True)

    def numbered_as(self, other: ViewedBody) -> ViewedBody:
        """The body with the numbers that its rests have in another, which it is a little beside."""
        return replace(self, numbers=_numbers(self.poses, other.poses, other.numbers))

    def _analyzed(
        self, hull: ConvexHull, center: Floats, source: str, *, follows: bool
    ) -> ViewedBody:
        poses = analyze(hull, center, source).under(self.poses.prior)
        numbers = _numbers(poses, self.poses, self.numbers)
        return replace(self, poses=poses, numbers=numbers, follows=follows)


def _wanted(target: Floats | None, outcome: int) -> float | None:
    return None if target is None else float(target[outcome])


def _numbers(poses: RestPoses, before: RestPoses, known: Integers) -> Integers:
    """(r,) numbers of rests: of the rest before on the same facet, or on another hull of the one
    that is nearest to each and to no other, else the lowest that are free."""
    numbers = np.full(len(poses.facets), -1, dtype=np.int64)
    if poses.hull is before.hull:
        place = np.full(len(poses.hull.normals), -1, dtype=np.int64)
        place[before.facets] = known
        numbers = place[poses.facets]
    else:
        angles = angle_between(poses.normals[:, None], before.normals[None])
        nearest = angles.argmin(axis=1)
        mutual = angles.argmin(axis=0)[nearest] == np.arange(len(numbers))
        kept = mutual & (angles.min(axis=1) <= SAME_REST)
        numbers[kept] = known[nearest[kept]]
    free = np.setdiff1d(np.arange(len(known) + len(numbers)), known)
    numbers[numbers < 0] = free[: np.count_nonzero(numbers < 0)]
    return numbers
