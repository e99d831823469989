"""The center of mass within a region that serves a goal best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.balance.center.descent import Descent
from dicedesign.balance.center.fewest import fewest_rests, steadiest
from dicedesign.balance.center.goals import EqualOdds, FewestRests, Goal, Standing
from dicedesign.balance.center.objectives import Objective, objective_of, pose_direction
from dicedesign.balance.center.regions import Halfspaces, points_within
from dicedesign.balance.center.rests_at import pose_odds, rests_at
from dicedesign.balance.center.stability import Stability
from dicedesign.concave.hollow.least_within import least_within
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.rest.poses import RestPoses, analyse
from dicedesign.runtime.arrays import Floats

__all__ = ["BestCenter", "CenterSearch", "best_center", "whole_hull"]

INSIDE: Final = 0.95
"""Part of a hull, about its centroid, that a center of mass may be in: at its surface a body
balances on nothing."""

APART: Final = 0.03
"""Distance of two starts, over the size of the body, at which both are worth a descent."""

SHARES: Final = (1.0, 0.1, 0.0)
"""How much it counts in turn that little is left to poses that a goal is not about."""

GOOD: Final = 0.5
"""Part of the tolerance within which ends are told apart by how near odds jump, and by what is left
to other poses."""

CLEAR: Final = 2e-3
"""Distance over the size of the body that a center of mass is to keep from where a rest appears or
vanishes, and its odds jump: a print of 50 mm is off by as much as that, 0.1 mm."""


MANY: Final = 1000
"""Corners of a hull from which on less is tried."""


@dataclass(frozen=True)
class CenterSearch:
    """How long is looked for a center of mass; `samples` are tried, `descents` start at the best of
    them, each of at most `steps` steps of each kind."""

    samples: int = 600
    descents: int = 10
    steps: int = 60

    def for_corners(self, count: int) -> CenterSearch:
        """The same for a hull of so many corners: fewer of all where they are many, as each center
        takes as much longer."""
        part = min(1.0, MANY / count)
        least = min(self.descents, 3), min(self.steps, 15), min(self.samples, 60)
        return CenterSearch(
            samples=max(least[2], round(part * self.samples)),
            descents=max(least[0], round(part * self.descents)),
            steps=max(least[1], round(part * self.steps)),
        )


@dataclass(frozen=True, eq=False)
class BestCenter:
    """A center of mass and what it does.

    Attributes
    ----------
    center: (3,) in the body's unit.
    directions: (c, 3) down in the poses that the goal is about, of fewest rests of all poses.
    before: (c,) odds of these poses with the center of mass that the body has; odds: (c,) now.
    wanted: (c,) or None where the goal is no number.
    rests: facets that the body rests on; rests_before: those as it is.
    reached: whether the goal is.
    clearance: distance, in the body's unit, to the nearest center at which a rest appears or
        vanishes.
    """

    center: Floats
    directions: Floats
    before: Floats
    odds: Floats
    wanted: Floats | None
    rests: int
    rests_before: int
    reached: bool
    clearance: float

    @property
    def error(self) -> float | None:
        """Largest difference of odds from what is wanted; None where that is no number."""
        return None if self.wanted is None else float(np.abs(self.odds - self.wanted).max())


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
    steps by the gradient of the odds in the center of mass, and steps along the axes where the odds
    jump. Few rests are found by linear programs (`fewest_rests`). The same for the same body.

    Parameters
    ----------
    poses: of the body as it is.
    goal: what is wanted.
    region: where the center of mass may be, inside of the body's hull; None for all of that, but
        for what is next to its surface.
    tolerance: largest difference of odds with which a goal is reached.

    Raises
    ------
    InputError: the body has no such pose.
    """
    search = _Search(poses, region or whole_hull(poses.hull), options or CenterSearch())
    if isinstance(goal, FewestRests):
        return search.fewest()
    center = search.serving(objective_of(goal, poses), isinstance(goal, EqualOdds), tolerance)
    if isinstance(goal, Standing):
        return search.standing(center, pose_direction(goal, poses))
    return search.judged(center, objective_of(goal, poses), tolerance)


class _Search:
    def __init__(self, poses: RestPoses, region: ConvexHull, options: CenterSearch) -> None:
        self.poses, self.hull = poses, poses.hull
        self.options = options = options.for_corners(len(poses.hull.vertices))
        self.within = Halfspaces.of_hull(region)
        starts = [region.centroid[None], points_within(region, options.samples)]
        if (self.within.heights(poses.center_of_mass) >= 0.0).all():
            starts.insert(0, poses.center_of_mass[None])
        self.samples = np.concatenate(starts)
        self.stability = Stability(self.hull)

    def fewest(self) -> BestCenter:
        """With as few rests as can be found."""
        counts = self.stability.counts(self.samples)
        starts = self._apart(counts.astype(np.float64))
        center, _ = fewest_rests(self.stability, self.within, starts, self.options.steps)
        poses = analyse(self.hull, center)
        reached = len(poses.facets) < len(self.poses.facets) or len(poses.facets) == 1
        return self._best(center, poses.normals, None, reached)

    def standing(self, center: Floats, direction: Floats) -> BestCenter:
        """That of the largest odds of a pose."""
        if self.stability.counts(center[None])[0] == 1:
            center = steadiest(self.stability, self.within, center)
        poses = analyse(self.hull, center)
        odds, top = (pose_odds(poses, down[None])[0] for down in (direction, poses.normals[0]))
        return self._best(center, direction[None], None, bool(odds >= top))

    def judged(self, center: Floats, objective: Objective, tolerance: float) -> BestCenter:
        """By the odds that are wanted."""
        rests = rests_at(self.hull, center)
        if rests is None:
            raise InputError(
                "region: expected a center of mass with rests, got none; take a larger region"
            )
        served = objective(rests, 0.0)
        directions, wanted = served.directions, served.wanted
        if len(directions) < len(wanted):
            return self._best(center, directions, wanted[: len(directions)], False)
        return self._best(center, directions, wanted, served.error <= tolerance)

    def serving(self, objective: Objective, shared: bool, tolerance: float) -> Floats:
        """The center of mass whose residuals are least.

        shared: whether little is to be left to other poses, as far as that costs nothing.
        """
        descents = [
            Descent(self.hull, objective, self.within, share)
            for share in (SHARES if shared else (0.0,))
        ]
        values = np.array([descents[0].value(center) for center in self.samples])
        ends = []
        for center in self._apart(values):
            for descent in descents[:-1]:
                center, _ = descent.by_squares(center, descent.value(center), self.options.steps)
            center, _ = descents[-1].from_center(center, self.options.steps)
            ends.append(self._cleared(center, objective))
        good = (GOOD * tolerance) ** 2

        def rank(end: Floats) -> tuple[float, bool, float]:
            is_near = self.stability.clearance(end) < 0.5 * CLEAR * self.hull.diameter
            return max(descents[-1].value(end), good), is_near, descents[0].value(end)

        return min(ends, key=rank)

    def _apart(self, values: Floats) -> Floats:
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

    def _cleared(self, center: Floats, objective: Objective) -> Floats:
        """The best near a center of mass (3,) that keeps clear of where odds jump, as far as there
        is room."""
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
        return Descent(self.hull, objective, cell, 0.0).from_center(
            center + step, self.options.steps
        )[0]

    def _best(
        self, center: Floats, directions: Floats, wanted: Floats | None, reached: bool
    ) -> BestCenter:
        now = analyse(self.hull, center)
        return BestCenter(
            center=center,
            directions=directions,
            before=pose_odds(self.poses, directions),
            odds=pose_odds(now, directions),
            wanted=wanted,
            rests=len(now.facets),
            rests_before=len(self.poses.facets),
            reached=reached,
            clearance=self.stability.clearance(center),
        )
