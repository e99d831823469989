"""Search for the center of mass within a region that serves a goal best."""

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
"""Norm of the residuals at which a goal is reached exactly."""

DAMPING: Final = (1e-3, 0.2, 8.0, 1e12)
"""Damping of the first step, relative to the largest squared slope; factors after an accepted and
after a rejected step; and largest damping, at which the descent stops."""

FIRST_SEARCH: Final = 0.02
"""Length of the first steps along the axes, relative to the diameter of the hull."""

LAST_SEARCH: Final = 1e-5
"""Least length of steps along the axes, relative to the diameter of the hull."""

AXES: Final = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True)
class Descent:
    """Descent of one objective for one hull.

    Attributes
    ----------
    within: region of the center of mass.
    share: weight of the probability of other poses.
    steps: largest number of steps of each kind.
    """

    hull: ConvexHull
    objective: Objective
    within: Halfspaces
    share: float
    steps: int

    def value(self, center: Floats) -> float:
        """Sum of squares at a center of mass (3,); infinite outside of the region."""
        return self._serve(center)[0]

    def from_center(self, center: Floats) -> Floats:
        """Center of mass at the end of a descent.

        Levenberg-Marquardt steps minimize the quadratic model within the half-spaces. If none
        descends, at jumps or kinks of the probabilities, steps of decreasing length along the axes
        are tried.
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
        """Center of mass after Levenberg-Marquardt steps alone, and its sum of squares."""
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


LEAST_DEPTH: Final = 1e-9
"""Least distance of a center of mass beyond a side, relative to the diameter of the hull."""


def fewest_rests(stability: Stability, within: Halfspaces, centers: Floats, steps: int) -> Floats:
    """Center of mass with fewest rests in a greedy search from starts (n, 3).

    From each start, one resting facet after the other is made unstable: the center of mass moves
    beyond one of its sides, and stays beyond a side of each facet that is no rest. A linear program
    for each side, nearest sides first, finds the center farthest beyond. The result need not be the
    global minimum.

    within: region of the center of mass; steps: largest number of facets for each start.
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
    """Center of mass farthest from where a rest appears, among those without other rests than a
    center (3,) has."""
    edges, least = stability.outermost(center)
    place, depth = within.and_within(stability.beyond(edges[least <= 0.0])).deepest
    if not 0.0 < depth < np.inf or stability.counts(place[None])[0] > (least > 0.0).sum():
        return center
    return place


def _one_less(stability: Stability, within: Halfspaces, center: Floats) -> Floats | None:
    """Center of mass with one rest less and no new rest; None if there is none."""
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
        if LEAST_DEPTH * hull.diameter < depth < np.inf:
            return place
    return None


INSIDE: Final = 0.95
"""Scale of a hull, about its centroid, in which a center of mass may be: not next to the
surface."""

APART: Final = 0.03
"""Least distance of two starts, relative to the diameter of the hull."""

SHARES: Final = (1.0, 0.1, 0.0)
"""Weights of the probability of other poses, in turn."""

GOOD: Final = 0.5
"""Share of the tolerance within which results are ranked by their distance from jumps and by the
probability of other poses."""

CLEAR: Final = 2e-3
"""Distance of a center of mass from jumps, relative to the diameter of the hull: 0.1 mm, the error
of a print, for 50 mm."""


@dataclass(frozen=True, eq=False)
class BestCenter:
    """Center of mass with its effect on a goal.

    Attributes
    ----------
    center: (3,) in the body's unit.
    directions: (c, 3) directions that point down in the poses of the goal; in all poses for
        `FewestRests`.
    before, probabilities: (c,) of these poses with the original and the new center of mass.
    wanted: (c,) probabilities, or None if the goal has none.
    rests, rests_before: numbers of rests.
    reached: whether the goal is reached.
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
        """Largest difference from the wanted probabilities; None without any."""
        return (
            None if self.wanted is None else float(np.abs(self.probabilities - self.wanted).max())
        )


def whole_hull(hull: ConvexHull) -> ConvexHull:
    """Hull without the region next to its surface."""
    middle = hull.centroid
    return convex_hull(middle + INSIDE * (hull.vertices - middle))


def best_center(
    poses: RestPoses,
    goal: Goal,
    region: ConvexHull | None = None,
    tolerance: float = 0.005,
    options: CenterSearch | None = None,
) -> BestCenter:
    """Find the center of mass in a region that serves a goal best; deterministic.

    Points that fill the region are evaluated, and descents start at the best: Levenberg-Marquardt
    steps by gradients of the probabilities, and steps along the axes at jumps. Fewest rests are
    found by linear programs (`fewest_rests`).

    Parameters
    ----------
    poses: of the original body.
    goal: wanted probabilities.
    region: allowed centers of mass, inside of the body's hull; None for `whole_hull`.
    tolerance: largest difference of probabilities with which a goal is reached.
    options: effort of the search.

    Raises InputError if the body has no such pose.
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
    """Search for the center of mass of one body in one region."""

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
        """Center of mass with the smallest residuals.

        shared: whether the probability of other poses is minimized, too, if that costs nothing.
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
        """Samples with the smallest values that are not next to each other."""
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
        """Best center of mass near one (3,) that keeps away from jumps, as far as there is room."""
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
