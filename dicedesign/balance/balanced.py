"""Bodies whose center of mass is moved to where it serves a goal best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, get_args

import numpy as np

from dicedesign.balance.best_center import BestCenter, best_center, whole_hull
from dicedesign.balance.goals import FewestRests, Goal, Standing, objective_of, pose_probabilities
from dicedesign.balance.options import BalanceOptions, WayName
from dicedesign.balance.regions import Halfspaces
from dicedesign.balance.ways import MovedCenter, move_center, reachable_shifts
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.surfaces.repair import FINEST, input_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import facet_of_rest
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILE_PROBABILITIES, LEAST_MM, MOST_MM


@dataclass(frozen=True, eq=False)
class Balanced(BestCenter):
    """Body with a moved center of mass, by its files as they were read back. Lengths are in mm.

    Attributes
    ----------
    by: way in which the center of mass was moved.
    center_before, center_wanted: (3,) centers of mass of the original body, and of the search.
    made: files of the body.
    poses_before, poses: rests of the original body, and of the body in the files.
    notes: changes and advice, one sentence each.
    """

    by: str
    center_before: Floats
    center_wanted: Floats
    made: MovedCenter
    poses_before: RestPoses
    poses: RestPoses
    notes: tuple[str, ...]

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
            "center_before_mm": self.center_before.tolist(),
            "center_wanted_mm": self.center_wanted.tolist(),
            "center_mm": self.center.tolist(),
            "clearance_mm": self.clearance,
            "wall_mm": self.made.wall_mm,
            "made": dict(self.made.facts),
            "notes": list(self.notes),
        }


PARTS: Final = (1.0, 0.85, 0.7)
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

    def missing(one: Balanced) -> float:
        """Distance of a result from the goal."""
        if isinstance(goal, FewestRests):
            return float(one.rests)
        return 1.0 - float(one.probabilities[0]) if one.error is None else one.error

    return min(results, key=missing)


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
    directions = now.normals if isinstance(goal, FewestRests) else best.directions
    probabilities = pose_probabilities(now, directions)
    most = max(options.tolerance, FILE_PROBABILITIES)
    if best.wanted is not None:
        still_serves = bool(np.abs(probabilities - best.wanted).max() <= most)
    elif isinstance(goal, Standing):
        still_serves = bool(probabilities[0] >= best.probabilities[0] - most)
    else:
        still_serves = len(now.facets) <= best.rests
    advice = []
    if not best.reached:
        farther = {"cavity": "a thinner wall_mm", "infill": "a larger difference of infills"}[way]
        advice = [
            f"no center of mass within reach has the goal; {farther} reaches farther, and three "
            "coordinates control at most three probabilities"
        ]
    elif not still_serves:
        advice = [
            "the file has other probabilities than its center of mass was chosen for: an edge of a "
            f"basin is {best.clearance:.2g} mm away; allow more tolerance, or take another way"
        ]
    by_file = {
        "center": moved.center,
        "directions": directions,
        "before": pose_probabilities(poses, directions),
        "probabilities": probabilities,
        "rests": len(now.facets),
        "reached": best.reached and still_serves,
    }
    return Balanced(
        **vars(best) | by_file,
        by=way,
        center_before=poses.center_of_mass,
        center_wanted=best.center,
        made=moved,
        poses_before=poses,
        poses=now,
        notes=(*notes, *moved.notes, *advice),
    )
