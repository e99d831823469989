"""Center of mass that serves a goal best, and bodies whose center of mass is moved there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import Any, get_args

import numpy as np

from dicedesign.balance.goals import (
    Descent,
    EqualProbabilities,
    FewestRests,
    Goal,
    Objective,
    Standing,
    objective_of,
    pose_probabilities,
)
from dicedesign.balance.options import BalanceOptions, CenterSearch, WayName
from dicedesign.balance.regions import (
    Halfspaces,
    Stability,
    fewest_rests,
    least_within,
    points_within,
    steadiest,
    whole_hull,
)
from dicedesign.balance.ways import MovedCenter, move_center, reachable_shifts
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.repair import FINEST, input_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import facet_of_rest
from dicedesign.rest.poses import RestPoses, analyze, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILE_PROBABILITIES, LEAST_MM, MOST_MM

APART = 0.03
"""Least distance of two starts, relative to the diameter of the hull."""

SHARES = (1.0, 0.1)
"""Weights of the probability of other poses, in turn; then it has none."""

GOOD = 0.5
"""Share of the tolerance within which results are ranked by their distance from jumps and by the
probability of other poses."""

CLEAR = 2e-3
"""Distance of a center of mass from jumps, relative to the diameter of the hull: 0.1 mm, the error
of a print, for 50 mm."""


@dataclass(frozen=True, eq=False)
class BestCenter:
    """Center of mass with its effect on a goal. Lengths are in the body's unit.

    Attributes
    ----------
    goal: the goal.
    poses_before, poses: rests with the original and the new center of mass.
    directions: (c, 3) directions that point down in the poses of the goal; in all poses for
        `FewestRests`.
    wanted: (c,) probabilities, or None if the goal has none.
    reached: whether the goal is reached.
    clearance: distance to the nearest center at which a rest appears or vanishes.
    rests_at_least: number of rests that every center in the region has at least, as far as
        `FewestRests` has proven; 1 for other goals.
    """

    goal: Goal
    poses_before: RestPoses
    poses: RestPoses
    directions: Floats
    wanted: Floats | None
    reached: bool
    clearance: float
    rests_at_least: int

    @property
    def center(self) -> Floats:
        """(3,) new center of mass."""
        return self.poses.center_of_mass

    @cached_property
    def before(self) -> Floats:
        """(c,) probabilities of the poses with the original center of mass."""
        return pose_probabilities(self.poses_before, self.directions)

    @cached_property
    def probabilities(self) -> Floats:
        """(c,) probabilities of the poses with the new center of mass."""
        return pose_probabilities(self.poses, self.directions)

    @property
    def rests_before(self) -> int:
        """Number of rests with the original center of mass."""
        return len(self.poses_before.facets)

    @property
    def rests(self) -> int:
        """Number of rests with the new center of mass."""
        return len(self.poses.facets)

    @property
    def error(self) -> float | None:
        """Largest difference from the wanted probabilities; None without any."""
        return None if self.wanted is None else self.shortfall

    @property
    def shortfall(self) -> float:
        """Distance from the goal: a number of rests, or a difference of probabilities."""
        if isinstance(self.goal, FewestRests):
            return self.rests
        wanted = 1.0 if self.wanted is None else self.wanted
        return float(np.abs(self.probabilities - wanted).max())


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
    found by branch and bound (`fewest_rests`).

    Parameters
    ----------
    poses: of the original body.
    goal: wanted probabilities.
    region: allowed centers of mass, inside of the body's hull; None for the hull for `FewestRests`,
        else `whole_hull`.
    tolerance: largest difference of probabilities with which a goal is reached.
    options: effort of the search, unless for `FewestRests`.

    Raises InputError if the body has no such pose, or the region is empty.
    """
    hull, stability = poses.hull, Stability(poses.hull)
    wanted, bound = None, 1
    if isinstance(goal, FewestRests):
        center, bound = fewest_rests(stability, Halfspaces.of_hull(region or hull))
        now = analyze(hull, center)
        directions = now.normals
        reached = len(now.facets) < len(poses.facets) or len(now.facets) == 1
    else:
        search = _CenterSearch(
            poses, stability, region or whole_hull(hull), options or CenterSearch()
        )
        objective = objective_of(goal, poses)
        center = search.serving(objective, isinstance(goal, EqualProbabilities), tolerance)
        if isinstance(goal, Standing) and stability.count(center) == 1:
            center = steadiest(stability, search.within, center)
        now = analyze(hull, center)
        served = objective(now, 0.0)
        directions = served.directions
        if isinstance(goal, Standing):
            top = pose_probabilities(now, now.normals[:1])
            reached = bool(pose_probabilities(now, directions) >= top)
        else:
            wanted = served.wanted[: len(directions)]
            error = np.abs(served.probabilities - served.wanted).max()
            reached = len(wanted) == len(served.wanted) and bool(error <= tolerance)
    clearance = stability.clearance(center)
    return BestCenter(goal, poses, now, directions, wanted, reached, clearance, bound)


class _CenterSearch:
    """Search for the center of mass of one body in one region."""

    def __init__(
        self, poses: RestPoses, stability: Stability, region: ConvexHull, options: CenterSearch
    ) -> None:
        self.hull, self.stability = poses.hull, stability
        self.options = options = options.for_corners(len(poses.hull.vertices))
        self.within = Halfspaces.of_hull(region)
        starts = [region.centroid[None], points_within(region, options.samples)]
        if (self.within.heights(poses.center_of_mass) >= 0.0).all():
            starts.insert(0, poses.center_of_mass[None])
        self.samples = np.concatenate(starts)

    def serving(self, objective: Objective, shared: bool, tolerance: float) -> Floats:
        """Center of mass with the smallest residuals.

        shared: whether the probability of other poses is minimized, too, if that costs nothing.
        """
        last = Descent(self.hull, objective, self.within, self.options.steps)
        others = [replace(last, share=share) for share in SHARES] if shared else []
        first = [*others, last][0]
        ends = []
        for center in self.apart(np.array([first.value(center) for center in self.samples])):
            for descent in others:
                center, _ = descent.by_squares(center)
            ends.append(self._clear(last.from_center(center), last))
        good = (GOOD * tolerance) ** 2

        def rank(end: Floats) -> tuple[float, bool, float]:
            is_near = self.stability.clearance(end) < 0.5 * CLEAR * self.hull.diameter
            return max(last.value(end), good), is_near, first.value(end)

        return min(ends, key=rank)

    def apart(self, values: Floats) -> Floats:
        """Samples with the smallest values that are not next to each other."""
        # Infinite values count only if all are infinite.
        best_first = np.argsort(values, kind="stable")[: np.isfinite(values).sum() or None]
        chosen = np.empty((0, 3))
        for center in self.samples[best_first]:
            if (norms(chosen - center) > APART * self.hull.diameter).all():
                chosen = np.vstack([chosen, center])
            if len(chosen) == self.options.descents:
                break
        return chosen

    def _clear(self, center: Floats, descent: Descent) -> Floats:
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
        return replace(descent, within=cell).from_center(center + step)


@dataclass(frozen=True, eq=False)
class Balanced(BestCenter):
    """Body with a moved center of mass, by its files as they were read back. Lengths are in mm.

    Attributes
    ----------
    by: way in which the center of mass was moved.
    center_wanted: (3,) center of mass of the search.
    made: files of the body.
    notes: changes and advice, one sentence each.
    """

    by: str
    center_wanted: Floats
    made: MovedCenter
    notes: tuple[str, ...]

    @property
    def center_before(self) -> Floats:
        """(3,) center of mass of the original body."""
        return self.poses_before.center_of_mass

    @property
    def numbers(self) -> tuple[int | None, ...]:
        """Numbers of the poses in `dicedesign rest` for the original body; None for new poses."""
        places = facet_of_rest(self.directions, self.poses_before.normals).tolist()
        return tuple(None if place < 0 else place + 1 for place in places)

    def data(self) -> dict[str, Any]:
        """Plain data."""
        names = "pose", "normal", "before", "wanted", "probabilities"
        wanted = [None] * len(self.before) if self.wanted is None else self.wanted.tolist()
        columns = [
            self.numbers,
            self.directions.tolist(),
            self.before.tolist(),
            wanted,
            self.probabilities.tolist(),
        ]
        return {
            "reached": self.reached,
            "by": self.by,
            "poses": [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)],
            "max_abs_error": self.error,
            "rests_before": self.rests_before,
            "rests": self.rests,
            "rests_at_least": self.rests_at_least,
            "center_before_mm": self.center_before.tolist(),
            "center_wanted_mm": self.center_wanted.tolist(),
            "center_mm": self.center.tolist(),
            "clearance_mm": self.clearance,
            "wall_mm": self.made.wall_mm,
            "made": dict(self.made.facts),
            "notes": list(self.notes),
        }


PARTS = (1.0, 0.85, 0.7)
"""Parts of the estimated reach of a way that are tried in turn."""


def balance_body(
    mesh: Body | Surface,
    goal: Goal,
    options: BalanceOptions | None = None,
    *,
    on_way: Callable[[str], None] = lambda _: None,
) -> Balanced:
    """Move the center of mass of a mesh to where it serves a goal best, by files that can be
    printed; the result is computed from the files as they are read back.

    Parameters
    ----------
    mesh: any that `dicedesign.rest_poses` takes, closed and of one solid, in mm unless a size is
        given; originally of uniform density.
    goal: wanted probabilities.
    options: way to move the center of mass, and material.
    on_way: called with the name of each way before it is tried.

    Raises
    ------
    InputError: the mesh does not bound one solid, the body has no such pose, or walls are too thick
        for the body.
    """
    body, options = body_of(mesh), options or BalanceOptions()
    surface, notes = size_surface(body, options.size_mm)
    poses = rest_poses(body_of(surface, body.name))
    if not isinstance(goal, FewestRests):
        # Raises early if the body has no such pose.
        objective_of(goal, poses)
    results: list[Balanced] = []
    failed: list[InputError] = []
    for name in get_args(WayName) if options.by is None else (options.by,):
        on_way(name)
        try:
            results.append(_balance(name, surface, poses, goal, options, notes))
        except InputError as error:
            failed.append(error)
            continue
        if results[-1].reached:
            return results[-1]
    if not results:
        raise failed[0]
    return min(results, key=attrgetter("shortfall"))


def size_surface(body: Body, size_mm: float | None) -> tuple[Surface, tuple[str, ...]]:
    """Surface of a body in mm, with float32 coordinates, and notes on its repair. Raises InputError
    or DegenerateBodyError if it does not bound one solid."""
    surface, notes, _ = input_surface(body, FINEST)
    points = surface.points
    diameter = convex_hull(points, single_precision=True).diameter
    if size_mm is not None:
        points = points * (size_mm / diameter)
    elif not LEAST_MM <= diameter <= MOST_MM:
        raise InputError(
            f"{body.name}: expected a size from {LEAST_MM:g} to {MOST_MM:g} mm, got "
            f"{diameter:.3g}, as coordinates are taken for mm; say how large it is to be with "
            "--size-mm"
        )
    return surface.with_points(points.astype(np.float32).astype(np.float64)), notes


def _balance(
    way: str,
    surface: Surface,
    poses: RestPoses,
    goal: Goal,
    options: BalanceOptions,
    notes: tuple[str, ...],
) -> Balanced:
    shifts = reachable_shifts(surface, way, options)
    for part in PARTS:
        reached = Halfspaces.of_hull(convex_hull(surface.centroid + part * shifts.vertices))
        region = reached.and_within(Halfspaces.of_hull(whole_hull(poses.hull))).corners()
        if region is None:
            raise InputError(
                "wall_mm: expected walls that leave a center of mass within reach, got none; "
                "reduce wall_mm"
            )
        best = best_center(poses, goal, region, options.tolerance, options.search)
        try:
            moved = move_center(surface, best.center, way, options)
            break
        except InputError:
            if part == PARTS[-1]:
                raise
    # From here on by the files.
    now = rest_poses(moved.body, moved.center)
    notes += moved.notes
    farther = {"cavity": "a thinner wall_mm", "infill": "a larger difference of infills"}[way]
    missed = f"no center of mass within reach has the goal; {farther} reaches farther"
    if isinstance(goal, FewestRests):
        proof = f"a center of mass within reach has at least {best.rests_at_least} rests"
        if best.rests > best.rests_at_least:
            proof += f" and may have fewer than the {best.rests} that were found"
        notes += (proof,)
    else:
        missed += ", and three coordinates control at most three probabilities"
    balanced = Balanced(
        goal=goal,
        poses_before=poses,
        poses=now,
        directions=now.normals if isinstance(goal, FewestRests) else best.directions,
        wanted=best.wanted,
        reached=best.reached,
        clearance=best.clearance,
        rests_at_least=best.rests_at_least,
        by=way,
        center_wanted=best.center,
        made=moved,
        notes=notes,
    )
    most = max(options.tolerance, FILE_PROBABILITIES)
    if best.wanted is None:
        most += best.shortfall
    if not best.reached:
        advice = missed
    elif balanced.shortfall > most:
        advice = (
            "the file has other probabilities than its center of mass was chosen for: an edge of a "
            f"basin is {best.clearance:.2g} mm away; allow more tolerance, or take another way"
        )
    else:
        return balanced
    return replace(balanced, reached=False, notes=(*balanced.notes, advice))
