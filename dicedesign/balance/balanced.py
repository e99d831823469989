"""A body whose center of mass is put where it serves a goal best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, get_args

import numpy as np

from dicedesign.balance.best_center import BestCenter, best_center, whole_hull
from dicedesign.balance.goals import FewestRests, Goal, Standing, objective_of, pose_probabilities
from dicedesign.balance.options import BalanceOptions, WayName
from dicedesign.balance.regions import Halfspaces, box_region
from dicedesign.balance.ways import Made, move_center, reachable_shifts
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.sphere import angle_between
from dicedesign.geometry.surfaces.repair import FINEST, input_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILE_PROBABILITIES, LEAST_MM, MOST_MM, SAME_REST_ANGLE


@dataclass(frozen=True, eq=False)
class Balanced:
    """A body with its center of mass elsewhere. Lengths are in mm.

    Attributes
    ----------
    reached: whether the file has what was wanted.
    by: the way in which it was made.
    directions: (c, 3) down in the poses that the goal is about, of fewest rests in all that are
        left, in the file.
    before: (c,) probabilities of these poses as the body came; probabilities: (c,) by the files
        read back.
    wanted: (c,) or None where the goal is no number.
    rests: by the files read back; rests_before.
    center_before, center_wanted, center: (3,) of mass; the last by the files read back.
    clearance: distance from the center of mass to the nearest at which a rest appears or vanishes.
    made: the files.
    poses_before, poses: rests of the body as it came, and by the files.
    notes: what was done, and what would do more, a sentence each.
    """

    reached: bool
    by: str
    directions: Floats
    before: Floats
    probabilities: Floats
    wanted: Floats | None
    rests: int
    rests_before: int
    center_before: Floats
    center_wanted: Floats
    center: Floats
    clearance: float
    made: Made
    poses_before: RestPoses
    poses: RestPoses
    notes: tuple[str, ...]

    @property
    def error(self) -> float | None:
        """Largest difference of probabilities from what is wanted; None where that is no number."""
        return (
            None if self.wanted is None else float(np.abs(self.probabilities - self.wanted).max())
        )

    @property
    def numbers(self) -> tuple[int | None, ...]:
        """Numbers of the poses in the list of `dicedesign rest` for the original body; None for
        new poses."""
        angles = angle_between(self.directions[:, None], self.poses_before.normals[None])
        nearest = angles.argmin(axis=1)
        near = angles.min(axis=1) <= SAME_REST_ANGLE
        return tuple(
            int(k) + 1 if is_near else None for k, is_near in zip(nearest, near, strict=True)
        )

    def data(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "reached": self.reached,
            "by": self.by,
            "poses": [
                {
                    "pose": number,
                    "normal": normal.tolist(),
                    "before": float(before),
                    "wanted": None if wanted is None else float(wanted),
                    "probabilities": float(probabilities),
                }
                for number, normal, before, wanted, probabilities in zip(
                    self.numbers,
                    self.directions,
                    self.before,
                    [None] * len(self.probabilities) if self.wanted is None else self.wanted,
                    self.probabilities,
                    strict=True,
                )
            ],
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
"""Of its reach that a way is asked for in turn, where it can do less than it seemed."""


def balance_body(
    body: Body,
    goal: Goal,
    options: BalanceOptions | None = None,
    *,
    on_way: Callable[[str], None] = lambda _: None,
) -> Balanced:
    """The solid of a mesh with the center of mass that serves a goal best, made so that it can be
    printed, and judged by its files as they are read back.

    Parameters
    ----------
    body: a closed mesh of one solid, in mm unless a size is given.
    goal: what is wanted of its probabilities, which are those of a solid of uniform density to
        begin with.
    options: where the center of mass may be, and how it gets there.
    on_way: called with the name of each way before it is tried, which takes some seconds.

    Raises
    ------
    InputError: the mesh is none of one solid; it has no such pose; the region has no center of mass
        that can be had; walls are too thick for the body.
    """
    wanted = options or BalanceOptions()
    surface, notes = size_surface(body, wanted.size_mm)
    poses = rest_poses(make_body(surface.points, surface.triangles, body.name))
    if not isinstance(goal, FewestRests):
        # Raises where the body has no such pose.
        objective_of(goal, poses)
    results: list[Balanced] = []
    failed: list[InputError] = []
    for name in get_args(WayName) if wanted.by is None else (wanted.by,):
        on_way(name)
        try:
            results.append(_by(name, surface, poses, goal, wanted, notes))
        except InputError as error:
            failed.append(error)
            continue
        if results[-1].reached:
            return results[-1]
    if not results:
        raise failed[0]

    def missing(one: Balanced) -> float:
        """Distance of a body from its goal."""
        if isinstance(goal, FewestRests):
            return float(one.rests)
        return 1.0 - float(one.probabilities[0]) if one.error is None else one.error

    return min(results, key=missing)


def size_surface(body: Body, size_mm: float | None) -> tuple[Surface, tuple[str, ...]]:
    """The surface of a body in mm, in coordinates of float32, and what was done to it. Raises
    InputError, or DegenerateBodyError, where it is none of one solid."""
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


def _by(
    way: str,
    surface: Surface,
    poses: RestPoses,
    goal: Goal,
    options: BalanceOptions,
    notes: tuple[str, ...],
) -> Balanced:
    shifts = reachable_shifts(surface, way, options)
    for part in PARTS:
        region = _region(surface, poses.hull, shifts, part, options)
        best = best_center(poses, goal, region, options.tolerance, options.search)
        try:
            moved = move_center(surface, best.center, way, options)
            break
        except InputError:
            if part == PARTS[-1]:
                raise
    # By the files.
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
    more = [*notes, *moved.notes]
    if best.reached and not still_serves:
        more.append(
            "the file has other probabilities than its center of mass was chosen for: an edge of "
            "a basin is "
            f"{best.clearance:.2g} mm away; allow more tolerance, or take another way"
        )
    elif not best.reached:
        more.append(_remedy(goal, best, way))
    return Balanced(
        reached=best.reached and still_serves,
        by=way,
        directions=directions,
        before=pose_probabilities(poses, directions),
        probabilities=probabilities,
        wanted=best.wanted,
        rests=len(now.facets),
        rests_before=len(poses.facets),
        center_before=poses.center_of_mass,
        center_wanted=best.center,
        center=moved.center,
        clearance=best.clearance,
        made=moved,
        poses_before=poses,
        poses=now,
        notes=tuple(more),
    )


def _region(
    surface: Surface,
    hull: ConvexHull,
    shifts: ConvexHull,
    part: float,
    options: BalanceOptions,
) -> ConvexHull:
    """Convex region in which the center of mass may lie and can be brought."""
    reached = convex_hull(surface.centroid + part * shifts.vertices)
    within = Halfspaces.of_hull(reached).and_within(Halfspaces.of_hull(whole_hull(hull)))
    if options.region == "hollow":
        hollow = reachable_shifts(surface, "cavity", options)
        allowed = Halfspaces.of_hull(convex_hull(surface.centroid + hollow.vertices))
        within = within.and_within(allowed)
    elif not isinstance(options.region, str):
        box = np.array(options.region, dtype=np.float64)
        within = within.and_within(box_region(box[:3], box[3:]))
    region = within.corners()
    if region is None:
        low, high = reached.vertices.min(axis=0), reached.vertices.max(axis=0)
        raise InputError(
            "region: expected a place for the center of mass that can be had, got none; from "
            f"{', '.join(f'{x:.3g}' for x in low)} to {', '.join(f'{x:.3g}' for x in high)} is "
            "within reach: move the box there, or reduce wall_mm"
        )
    return region


def _remedy(goal: Goal, best: BestCenter, way: str) -> str:
    """Advice on what would bring the body nearer to its goal."""
    farther = {
        "cavity": "a thinner wall_mm reaches farther",
        "infill": "infills farther apart reach farther, and so does a cavity",
    }[way]
    if isinstance(goal, FewestRests):
        return f"no center of mass within reach leaves fewer rests; {farther}"
    if isinstance(goal, Standing):
        return f"another pose stays more probable; {farther}"
    return (
        f"probabilities are off by up to {best.error:.3g}; {farther}, and three coordinates lead "
        "three "
        "probabilities at most: ask for fewer, or allow more tolerance"
    )
