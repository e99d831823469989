"""The center of mass within a region that serves a goal best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.balance.goals import (
    EqualProbabilities,
    FewestRests,
    Goal,
    Objective,
    Rests,
    ServedGoal,
    Standing,
    objective_of,
    pose_probabilities,
    rests_at,
)
from dicedesign.balance.options import CenterSearch
from dicedesign.balance.regions import Halfspaces, Stability, least_within, points_within
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.runtime.arrays import Floats

ENOUGH: Final = 1e-12
"""Root of the sum of squares at which probabilities are as wanted."""

DAMPING: Final = (1e-3, 0.2, 8.0, 1e12)
"""Of the first step, relative to the largest squared slope; its factors after a step that was taken
and after one that was not; and the most, where the descent stops."""

FIRST_SEARCH: Final = 0.02
"""Length of the first steps along the axes, over the size of the body."""

LAST_SEARCH: Final = 1e-5
"""Length below which none is tried."""

AXES: Final = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True)
class Descent:
    """Descents of one objective for one hull.

    Attributes
    ----------
    within: where the center of mass may be.
    share: how much it counts that little is left to other poses.
    steps: most of each kind.
    """

    hull: ConvexHull
    objective: Objective
    within: Halfspaces
    share: float
    steps: int

    def value(self, center: Floats) -> float:
        """The sum of squares, infinite where the center of mass (3,) is not allowed."""
        return self._serve(center)[0]

    def from_center(self, center: Floats) -> Floats:
        """The center of mass that is reached.

        Steps are those of Levenberg and Marquardt, each the least of its quadratic model within the
        half-spaces; where no such step leads down, as the probabilities jump or have a kink, steps
        along the axes are tried, of smaller and smaller length.
        """
        value = self.value(center)
        for _ in range(3):
            center, now = self.by_squares(center)
            length = FIRST_SEARCH * self.hull.diameter
            for _ in range(self.steps):
                if now <= ENOUGH**2 or length < LAST_SEARCH * self.hull.diameter:
                    break
                values = [self.value(center + length * axis) for axis in AXES]
                least = int(np.argmin(values))
                if values[least] < now:
                    center, now = center + length * AXES[least], values[least]
                else:
                    length *= 0.5
            if now <= ENOUGH**2 or now >= (1.0 - 1e-6) * value:
                break
            value = now
        return center

    def by_squares(self, center: Floats) -> tuple[Floats, float]:
        """Result of Levenberg-Marquardt steps alone, and its sum of squares."""
        damping, factor_less, factor_more, most = DAMPING
        value_at_center = self._serve(center)
        for _ in range(self.steps):
            value, rests, served = value_at_center
            if rests is None or served is None or value <= ENOUGH**2:
                break
            slopes = rests.slopes(served.weights)
            form, slope = slopes.T @ slopes, slopes.T @ served.residuals
            largest = float(np.diag(form).max())
            heights = self.within.heights(center).clip(0.0)
            while damping <= most and largest > 0.0:
                damped = form + damping * largest * np.eye(3)
                step = least_within(damped, slope, self.within.normals, heights)
                following = self._serve(center + step)
                if following[0] < value:
                    center, value_at_center, damping = (
                        center + step,
                        following,
                        damping * factor_less,
                    )
                    break
                damping *= factor_more
            else:
                break
            if value_at_center[0] > (1.0 - 1e-9) * value:
                break
        return center, value_at_center[0]

    def _serve(self, center: Floats) -> tuple[float, Rests | None, ServedGoal | None]:
        if (self.within.heights(center) < -1e-12 * self.hull.diameter).any():
            return np.inf, None, None
        rests = rests_at(self.hull, center)
        if rests is None:
            return np.inf, None, None
        served = self.objective(rests, self.share)
        return float(served.residuals @ served.residuals), rests, served


NOTHING: Final = 1e-9
"""Distance over the size of the body that a center of mass has to be beyond a side by."""


def fewest_rests(stability: Stability, within: Halfspaces, centers: Floats, steps: int) -> Floats:
    """The center of mass with fewest rests that is found from some (n, 3).

    From each, one facet after the other is left: over one of its edges, while the center of mass
    stays beyond a side of each facet that the body does not rest on. That is a linear program for
    each edge, which finds the center farthest beyond; it is solved for the facets first whose sides
    are nearest. No way is known to all that would tell the least number of all centers.

    within: where it may be; steps: most facets that are left from each.
    """
    best, fewest = centers[0], len(stability.hull.normals) + 1
    for start in centers:
        center, count = start, int(stability.counts(start[None])[0])
        for _ in range(steps):
            following = _one_less(stability, within, center)
            if following is None:
                break
            center, count = following, int(stability.counts(following[None])[0])
        if count < fewest:
            best, fewest = center, count
        if fewest == 1:
            break
    return steadiest(stability, within, best)


def steadiest(stability: Stability, within: Halfspaces, center: Floats) -> Floats:
    """The center of mass farthest from where a rest appears, with no facet to rest on that there is
    not with a center (3,)."""
    edges, least = stability.outermost(center)
    place, depth = within.and_within(stability.beyond(edges[least <= 0.0])).deepest
    if not 0.0 < depth < np.inf or stability.counts(place[None])[0] > (least > 0.0).sum():
        return center
    return place


def _one_less(stability: Stability, within: Halfspaces, center: Floats) -> Floats | None:
    """A center of mass with which the body does not rest on one facet that it does now, and on no
    other; None where none is found."""
    hull = stability.hull
    edges, least = stability.outermost(center)
    room = within.and_within(stability.beyond(edges[least <= 0.0]))
    resting = np.flatnonzero(least > 0.0)
    if len(resting) == 1:
        return None
    heights = stability.sides.heights(center)
    own = np.flatnonzero(np.isin(hull.facet, resting))
    for edge in own[np.argsort(heights[own], kind="stable")]:
        place, depth = room.and_within(stability.beyond(np.array([edge]))).deepest
        if NOTHING * hull.diameter < depth < np.inf:
            return place
    return None


INSIDE: Final = 0.95
"""Part of a hull, about its centroid, that a center of mass may be in: at its surface a body
balances on nothing."""

APART: Final = 0.03
"""Distance of two starts, over the size of the body, at which both are worth a descent."""

SHARES: Final = (1.0, 0.1, 0.0)
"""How much it counts in turn that little is left to poses that a goal is not about."""

GOOD: Final = 0.5
"""Part of the tolerance within which ends are distinguished by how near probabilities jump, and by
what is left to other poses."""

CLEAR: Final = 2e-3
"""Distance over the size of the body that a center of mass is to keep from where a rest appears or
vanishes, and its probabilities jump: a print of 50 mm is off by as much as that, 0.1 mm."""


@dataclass(frozen=True, eq=False)
class BestCenter:
    """A center of mass and what it does.

    Attributes
    ----------
    center: (3,) in the body's unit.
    directions: (c, 3) down in the poses that the goal is about, of fewest rests of all poses.
    before: (c,) probabilities of these poses with the center of mass that the body has;
        probabilities: (c,) now.
    wanted: (c,) or None where the goal is no number.
    rests: facets that the body rests on; rests_before: those as it is.
    reached: whether the goal is.
    clearance: distance, in the body's unit, to the nearest center at which a rest appears or
        vanishes.
    """

    center: Floats
    directions: Floats
    before: Floats
    probabilities: Floats
    wanted: Floats | None
    rests: int
    rests_before: int
    reached: bool
    clearance: float

    @property
    def error(self) -> float | None:
        """Largest difference of probabilities from what is wanted; None where that is no number."""
        return (
            None if self.wanted is None else float(np.abs(self.probabilities - self.wanted).max())
        )


def whole_hull(hull: ConvexHull) -> ConvexHull:
    """All of a hull but what is next to its surface."""
    middle = hull.centroid
    return convex_hull(middle + INSIDE * (hull.vertices - middle))


def best_center(
    poses: RestPoses,
    goal: Goal,
    region: ConvexHull | None = None,
    tolerance: float = 0.005,
    options: CenterSearch | None = None,
) -> BestCenter:
    """The center of mass in a region that serves a goal best.

    Points that fill the region are tried, and descents start at the best: Levenberg and Marquardt's
    steps by the gradient of the probabilities in the center of mass, and steps along the axes where
    the probabilities jump. Few rests are found by linear programs (`fewest_rests`). The same for
    the same body.

    Parameters
    ----------
    poses: of the body as it is.
    goal: what is wanted.
    region: where the center of mass may be, inside of the body's hull; None for all of that, but
        for what is next to its surface.
    tolerance: largest difference of probabilities with which a goal is reached.

    Raises
    ------
    InputError: the body has no such pose.
    """
    search = _CenterSearch(poses, region or whole_hull(poses.hull), options or CenterSearch())
    hull, stability, within = poses.hull, search.stability, search.within
    if isinstance(goal, FewestRests):
        starts = search.apart(stability.counts(search.samples).astype(np.float64))
        center = fewest_rests(stability, within, starts, search.options.steps)
        now, wanted = analyze(hull, center), None
        directions = now.normals
        reached = len(now.facets) < len(poses.facets) or len(now.facets) == 1
    else:
        objective = objective_of(goal, poses)
        center = search.serving(objective, isinstance(goal, EqualProbabilities), tolerance)
        if isinstance(goal, Standing) and stability.counts(center[None])[0] == 1:
            center = steadiest(stability, within, center)
        rests = rests_at(hull, center)
        if rests is None:
            raise InputError(
                "region: expected a center of mass with rests, got none; take a larger region"
            )
        now, served = analyze(hull, center), objective(rests, 0.0)
        directions = served.directions
        if isinstance(goal, Standing):
            wanted = None
            probabilities, top = (
                pose_probabilities(now, down)[0] for down in (directions, now.normals[:1])
            )
            reached = bool(probabilities >= top)
        else:
            wanted = served.wanted[: len(directions)]
            error = np.abs(served.probabilities - served.wanted).max()
            reached = len(wanted) == len(served.wanted) and bool(error <= tolerance)
    return BestCenter(
        center=center,
        directions=directions,
        before=pose_probabilities(poses, directions),
        probabilities=pose_probabilities(now, directions),
        wanted=wanted,
        rests=len(now.facets),
        rests_before=len(poses.facets),
        reached=reached,
        clearance=stability.clearance(center),
    )


class _CenterSearch:
    def __init__(self, poses: RestPoses, region: ConvexHull, options: CenterSearch) -> None:
        self.hull = poses.hull
        self.options = options = options.for_corners(len(poses.hull.vertices))
        self.within = Halfspaces.of_hull(region)
        starts = [region.centroid[None], points_within(region, options.samples)]
        if (self.within.heights(poses.center_of_mass) >= 0.0).all():
            starts.insert(0, poses.center_of_mass[None])
        self.samples = np.concatenate(starts)
        self.stability = Stability(self.hull)

    def serving(self, objective: Objective, shared: bool, tolerance: float) -> Floats:
        """The center of mass whose residuals are least.

        shared: whether little is to be left to other poses, as far as that costs nothing.
        """
        descents = [
            Descent(self.hull, objective, self.within, share, self.options.steps)
            for share in (SHARES if shared else (0.0,))
        ]
        values = np.array([descents[0].value(center) for center in self.samples])
        ends = []
        for center in self.apart(values):
            for descent in descents[:-1]:
                center, _ = descent.by_squares(center)
            ends.append(self._clear(descents[-1].from_center(center), objective))
        good = (GOOD * tolerance) ** 2

        def rank(end: Floats) -> tuple[float, bool, float]:
            is_near = self.stability.clearance(end) < 0.5 * CLEAR * self.hull.diameter
            return max(descents[-1].value(end), good), is_near, descents[0].value(end)

        return min(ends, key=rank)

    def apart(self, values: Floats) -> Floats:
        """The samples of the least values that are not next to each other."""
        order = np.argsort(values, kind="stable")
        order = order[np.isfinite(values[order])] if np.isfinite(values).any() else order
        chosen: list[Floats] = []
        for center in self.samples[order]:
            if len(chosen) == self.options.descents:
                break
            if all(norms(center - other) > APART * self.hull.diameter for other in chosen):
                chosen.append(center)
        return np.array(chosen)

    def _clear(self, center: Floats, objective: Objective) -> Floats:
        """The best near a center of mass (3,) that keeps clear of where probabilities jump, as far
        as there is room."""
        clear = CLEAR * self.hull.diameter
        if self.stability.clearance(center) >= clear:
            return center
        whole = self.stability.cell(center).and_within(self.within)
        depth = whole.deepest[1]
        if not 0.0 < depth < np.inf:
            return center
        clear = min(clear, 0.5 * depth)
        cell = self.stability.cell(center, clear).and_within(self.within)
        step = least_within(np.eye(3), np.zeros(3), cell.normals, cell.heights(center))
        descent = Descent(self.hull, objective, cell, 0.0, self.options.steps)
        return descent.from_center(center + step)
