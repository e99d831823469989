"""A body whose center of mass is put where it serves a goal best."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from dicedesign.balance.center.best_center import BestCenter, best_center, whole_hull
from dicedesign.balance.center.goals import FewestRests, Goal, Standing
from dicedesign.balance.center.objectives import objective_of
from dicedesign.balance.center.regions import Halfspaces, box_region
from dicedesign.balance.center.rests_at import pose_odds
from dicedesign.balance.options import BalanceOptions
from dicedesign.balance.result import Balanced
from dicedesign.balance.ways.cavity import CAVITY
from dicedesign.balance.ways.way import Made, Way
from dicedesign.balance.ways.ways import WAYS
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.repair.repair import FINEST, input_surface
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.tolerances import FILE_ODDS, LEAST_MM, MOST_MM

__all__ = ["balanced"]

PARTS: Final = (1.0, 0.85, 0.7)
"""Of its reach that a way is asked for in turn, where it can do less than it seemed."""


def balanced(
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
    goal: what is wanted of its odds, which are those of a solid of uniform density to begin with.
    options: where the center of mass may be, and how it gets there.
    on_way: called with the name of each way before it is tried, which takes some seconds.

    Raises
    ------
    InputError: the mesh is none of one solid; it has no such pose; the region has no center of mass
        that can be had; walls are too thick for the body.
    """
    wanted = options or BalanceOptions()
    surface, notes = sized_surface(body, wanted.size_mm)
    poses = rest_poses(make_body(surface.points, surface.triangles, body.name))
    if not isinstance(goal, FewestRests):
        # Raises where the body has no such pose.
        objective_of(goal, poses)
    found: list[Balanced] = []
    failed: list[InputError] = []
    for name in WAYS if wanted.by is None else (wanted.by,):
        on_way(name)
        try:
            found.append(_by(WAYS[name], surface, poses, goal, wanted, notes))
        except InputError as error:
            failed.append(error)
            continue
        if found[-1].reached:
            return found[-1]
    if not found:
        raise failed[0]
    return min(found, key=lambda one: _missing(one, goal))


def sized_surface(body: Body, size_mm: float | None) -> tuple[Surface, tuple[str, ...]]:
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
    return surface.moved(points.astype(np.float32).astype(np.float64)), notes


def _by(
    way: Way,
    surface: Surface,
    poses: RestPoses,
    goal: Goal,
    options: BalanceOptions,
    notes: tuple[str, ...],
) -> Balanced:
    shifts = way.reach(surface, options)
    for number, part in enumerate(PARTS):
        region = _region(surface, poses.hull, shifts, part, options)
        best = best_center(poses, goal, region, options.tolerance, options.search)
        try:
            made = way.make(surface, best.center, options)
        except InputError:
            if number + 1 == len(PARTS):
                raise
            continue
        return _judged(way, poses, goal, best, made, options, notes)
    raise AssertionError


def _region(
    surface: Surface,
    hull: ConvexHull,
    shifts: ConvexHull,
    part: float,
    options: BalanceOptions,
) -> ConvexHull:
    """Where the center of mass may be and can be brought."""
    reached = convex_hull(surface.centroid + part * shifts.vertices)
    within = Halfspaces.of_hull(reached).and_within(Halfspaces.of_hull(whole_hull(hull)))
    if options.region == "hollow":
        hollow = CAVITY.reach(surface, options)
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
            "within reach: move the box there, reduce wall_mm, or take weights"
        )
    return region


def _judged(
    way: Way,
    poses: RestPoses,
    goal: Goal,
    best: BestCenter,
    made: Made,
    options: BalanceOptions,
    notes: tuple[str, ...],
) -> Balanced:
    """By the files."""
    now = rest_poses(made.body, made.center)
    directions = now.normals if isinstance(goal, FewestRests) else best.directions
    odds = pose_odds(now, directions)
    most = max(options.tolerance, FILE_ODDS)
    if best.wanted is not None:
        kept = bool(np.abs(odds - best.wanted).max() <= most)
    elif isinstance(goal, Standing):
        kept = bool(odds[0] >= best.odds[0] - most)
    else:
        kept = len(now.facets) <= best.rests
    more = [*notes, *made.notes]
    if best.reached and not kept:
        more.append(
            "the file has other odds than its center of mass was chosen for: an edge of a basin is "
            f"{best.clearance:.2g} mm away; allow more tolerance, or take another way"
        )
    elif not best.reached:
        more.append(_remedy(goal, best, way.name))
    return Balanced(
        reached=best.reached and kept,
        by=way.name,
        directions=directions,
        before=pose_odds(poses, directions),
        odds=odds,
        wanted=best.wanted,
        rests=len(now.facets),
        rests_before=len(poses.facets),
        center_before=poses.center_of_mass,
        center_wanted=best.center,
        center=made.center,
        clearance=best.clearance,
        made=made,
        poses_before=poses,
        poses=now,
        notes=tuple(more),
    )


def _remedy(goal: Goal, best: BestCenter, way: str) -> str:
    """What would do more."""
    farther = {
        "cavity": "a thinner wall_mm reaches farther",
        "infill": "infills farther apart reach farther, and so does a cavity",
        "weights": "heavier weights or a larger size reach farther",
    }[way]
    if isinstance(goal, FewestRests):
        return f"no center of mass within reach leaves fewer rests; {farther}"
    if isinstance(goal, Standing):
        return f"another pose stays more probable; {farther}"
    assert best.error is not None
    return (
        f"odds are off by up to {best.error:.3g}; {farther}, and three coordinates lead three "
        "odds at most: ask for fewer, or allow more tolerance"
    )


def _missing(one: Balanced, goal: Goal) -> float:
    """How far from its goal a body is."""
    if isinstance(goal, FewestRests):
        return float(one.rests)
    if isinstance(goal, Standing):
        return 1.0 - float(one.odds[0])
    assert one.error is not None
    return one.error
