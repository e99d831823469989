"""Body on the page: its rows of probabilities, changes by dragging, and decimation for display."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import angle_between
from dicedesign.recipe.pipeline import Work
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import MomentumMixture
from dicedesign.throws.momentum_probabilities import momentum_probabilities
from dicedesign.throws.rigid_body import RigidBody, rigid_body

CLEARANCE = 1e-3
"""Least distance of a center of mass from the surface, as a part of the way from the centroid."""


def pull_inside(hull: ConvexHull, point: Floats) -> tuple[Floats, bool]:
    """Return a point (3,) inside a hull, and whether the given point (3,) was inside.

    A point outside moves toward the centroid until it is just below the surface. Raises InputError:
    the point is not three finite numbers.
    """
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError(
            f"center of mass: expected three finite numbers, got {point.tolist()}; type numbers"
        )
    # Height over each facet that is lost on the way; 1 means that the way ends in its plane.
    losses = 1.0 - hull.heights(point) / hull.heights(hull.centroid)
    largest = float(losses.max())
    if largest <= 1.0 - CLEARANCE:
        return point, True
    return hull.centroid + (1.0 - CLEARANCE) / largest * (point - hull.centroid), False


def facet_vertices(hull: ConvexHull, facet: int) -> Integers:
    """(c,) vertices of a facet, counterclockwise."""
    return hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]


MAX_DRAWN_TRIANGLES = 150_000
"""Larger meshes are decimated for display."""

FINEST_GRID = 256
"""Cells along the longest side of a mesh in the first attempt to decimate it."""


def decimate(points: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """Keep one of the points (n, 3) in each cell of a grid, for at most `MAX_DRAWN_TRIANGLES`.

    The grid is about as fine as possible. A smaller mesh is returned unchanged. Source: Rossignac
    and Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993.
    """
    fewer, merged = points, triangles
    lowest, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = FINEST_GRID
    while len(merged) > MAX_DRAWN_TRIANGLES:
        cell = np.minimum((points - lowest) * (cells / extent), cells - 1).astype(np.int64)
        keys = cell @ [cells**2, cells, 1]
        _, first, group = np.unique(keys, return_index=True, return_inverse=True)
        fewer, merged = points[first], group[triangles]
        merged = merged[(merged != np.roll(merged, 1, axis=1)).all(axis=1)]
        # The number of triangles grows with the square of the number of cells along a side.
        cells = int(0.95 * cells * np.sqrt(MAX_DRAWN_TRIANGLES / (len(merged) + 1)))
    return fewer, merged


SAME_REST_ANGLE = np.radians(20.0)
"""A rest keeps its number if its facet turns by at most this angle in one move."""

ELSEWHERE = "other"
"""Label of the row for rests without an outcome."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes of a die.

    Attributes
    ----------
    labels: labels of the k outcomes.
    directions: (f, 3) unit vectors in the frame of the body, down on the labeled faces.
    target: (k,) target probabilities, or None.
    prior: distribution of the orientation at release; None is uniform.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    """

    labels: tuple[str, ...]
    directions: Floats
    target: Floats | None = None
    prior: Prior | str | None = None
    outcome_of: Integers | None = None


def outcomes_of(work: Work) -> Outcomes:
    """Outcomes of a design, by the faces of its target."""
    return Outcomes(
        work.target.labels,
        work.die.directions,
        work.target.probabilities,
        work.recipe.prior,
        work.target.outcome_of_face,
    )


@dataclass(frozen=True)
class ProbabilityRow:
    """Row of the table of probabilities.

    Attributes
    ----------
    label: label of the outcome, or number of the rest.
    probability: probability without momentum; target: target probability, or None.
    """

    label: str
    probability: float
    target: float | None = None


@dataclass(frozen=True, eq=False)
class ViewedShape:
    """Shape, independent of its center of mass.

    Attributes
    ----------
    body: mesh that was read, or dragged hull.
    poses: rests for any center of mass.
    """

    body: Body
    poses: RestPoses

    @cached_property
    def inertia(self) -> Floats:
        """(3, 3) inertia tensor of the uniform solid over its mass, about its centroid."""
        return rigid_body(self.body, self.poses).inertia


@dataclass(frozen=True, eq=False)
class ViewedBody:
    """State of the body on the page.

    Attributes
    ----------
    name: title on the page.
    shape: mesh and hull.
    poses: rests.
    outcomes: outcomes of a die, or None.
    numbers: (r,) numbers of the rests, from 0, which dragging does not change.
    has_uniform_center: the center of mass stays at the centroid of the hull when the hull changes.
    is_dragged: the hull is no longer the hull of the mesh.
    """

    name: str
    shape: ViewedShape
    poses: RestPoses
    outcomes: Outcomes | None
    numbers: Integers
    has_uniform_center: bool
    is_dragged: bool = False

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
        """Analyze a body, unless its `poses` are known. Raises as `rest_poses`.

        center_of_mass: as in `rest_poses`.
        """
        if poses is None:
            poses = rest_poses(body, center_of_mass)
        if outcomes is not None:
            poses = poses.under(outcomes.prior)
        source = poses.center_of_mass_source
        offset = np.abs(poses.center_of_mass - poses.hull.centroid).max()
        extent = float(np.ptp(poses.hull.vertices, axis=0).max())
        is_uniform = source == "uniform solid hull" or (
            source == "uniform solid" and bool(offset <= 1e-6 * extent)
        )
        numbers = np.arange(len(poses.facets))
        shape = ViewedShape(body, poses)
        return cls(name or body.name, shape, poses, outcomes, numbers, is_uniform)

    @property
    def hull(self) -> ConvexHull:
        """Convex hull."""
        return self.poses.hull

    @property
    def center(self) -> Floats:
        """(3,) center of mass, in the unit of the body."""
        return self.poses.center_of_mass

    @cached_property
    def _outcome_probabilities(self) -> OutcomeProbabilities:
        assert self.outcomes is not None
        faces = self.outcomes.directions, self.outcomes.outcome_of
        return outcome_probabilities(self.poses, *faces)

    @cached_property
    def row_of_rest(self) -> Integers:
        """(r,) index in `rows` of each rest."""
        if self.outcomes is None:
            return np.argsort(np.argsort(self.numbers, kind="stable"))
        outcome_of_rest = self._outcome_probabilities.outcome_of_rest
        return np.where(outcome_of_rest >= 0, outcome_of_rest, len(self.outcomes.labels))

    @cached_property
    def rows(self) -> tuple[ProbabilityRow, ...]:
        """One row per rest, by number; or one row per outcome, and one for the other rests."""
        if self.outcomes is None:
            pairs = sorted(zip(self.numbers, self.poses.probabilities, strict=True))
            return tuple(ProbabilityRow(str(n + 1), float(p)) for n, p in pairs)
        labels, target = self.outcomes.labels, self.outcomes.target
        outcomes = self._outcome_probabilities
        wanted = [None] * len(labels) if target is None else target.tolist()
        columns = zip(labels, outcomes.probabilities.tolist(), wanted, strict=True)
        rows = [ProbabilityRow(*values) for values in columns]
        if (outcomes.outcome_of_rest < 0).any():
            rows.append(ProbabilityRow(ELSEWHERE, outcomes.elsewhere))
        return tuple(rows)

    @cached_property
    def rigid(self) -> RigidBody:
        """Rigid body for throws, with the inertia of the uniform solid for any center of mass."""
        return rigid_body(self.shape.body, self.poses, self.shape.inertia)

    def throw_probabilities(self, mixture: MomentumMixture | None) -> Floats:
        """(rows,) probabilities of the momentum model of a table."""
        uniform_poses = self.poses.under(None)
        of_facet = np.zeros(len(self.hull.normals))
        of_facet[uniform_poses.facets] = momentum_probabilities(uniform_poses, self.rigid, mixture)
        of_rest = of_facet[self.poses.facets]
        return np.bincount(self.row_of_rest, of_rest, len(self.rows)).astype(np.float64)

    def with_center(self, point: Floats) -> tuple[ViewedBody, bool]:
        """Move the center of mass to a point (3,), and say whether that was outside the hull.

        The center of mass stays inside, see `pull_inside`. Raises InputError: the point is not
        three finite numbers.
        """
        center, is_inside = pull_inside(self.hull, np.asarray(point, dtype=np.float64))
        return self._analyze(self.hull, center, has_uniform_center=False), not is_inside

    def with_uniform_center(self) -> ViewedBody:
        """Move the center of mass to the centroid of the hull, and keep it there."""
        return self._analyze(self.hull, self.hull.centroid, has_uniform_center=True)

    def with_vertices(self, vertices: Integers, points: Floats) -> ViewedBody:
        """Move vertices (v,) of the hull to points (v, 3).

        The center of mass stays where it is if it is inside the new hull and not uniform. Raises
        DegenerateBodyError.
        """
        if not np.isfinite(points).all():
            raise InputError("hull: expected finite coordinates, got others; drag less far")
        corners = self.hull.vertices.copy()
        corners[vertices] = points
        hull = convex_hull(corners)
        is_uniform = self.has_uniform_center
        center = hull.centroid if is_uniform else pull_inside(hull, self.center)[0]
        changed = self._analyze(hull, center, has_uniform_center=is_uniform)
        body = Body(hull.vertices, hull.triangles, self.shape.body.name, False, ())
        return replace(changed, shape=ViewedShape(body, changed.poses), is_dragged=True)

    def _analyze(self, hull: ConvexHull, center: Floats, *, has_uniform_center: bool) -> ViewedBody:
        source = "uniform solid hull" if has_uniform_center else "given"
        poses = analyze(hull, center, source).under(self.poses.prior)
        numbers = _match_numbers(poses, self.poses, self.numbers)
        return replace(self, poses=poses, numbers=numbers, has_uniform_center=has_uniform_center)


def _match_numbers(poses: RestPoses, before: RestPoses, known: Integers) -> Integers:
    """(r,) numbers of rests, from the numbers known (b,) of the rests before.

    A rest keeps the number of its facet. On another hull, two rests match if each is the nearest to
    the other. All other rests get the lowest free numbers.
    """
    numbers = np.full(len(poses.facets), -1, dtype=np.int64)
    if poses.hull is before.hull:
        number_of_facet = np.full(len(poses.hull.normals), -1, dtype=np.int64)
        number_of_facet[before.facets] = known
        numbers = number_of_facet[poses.facets]
    else:
        angles = angle_between(poses.normals[:, None], before.normals[None])
        nearest = angles.argmin(axis=1)
        is_mutual = angles.argmin(axis=0)[nearest] == np.arange(len(numbers))
        matches = is_mutual & (angles.min(axis=1) <= SAME_REST_ANGLE)
        numbers[matches] = known[nearest[matches]]
    free = np.setdiff1d(np.arange(len(known) + len(numbers)), known)
    numbers[numbers < 0] = free[: np.count_nonzero(numbers < 0)]
    return numbers
