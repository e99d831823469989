"""A finished die that keeps the shape of a surface, ready to be drawn."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.report.charts.palette import BASINS, repeated, rgb
from dicedesign.report.render.cameras import three_cameras
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Shell, Surface
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = [
    "cameras_around",
    "outcome_colors",
    "outcome_tints",
    "shell_of",
    "surface_of",
    "surfaces_before_and_after",
]


@lru_cache(maxsize=1)
def surface_of(die: FinishedDie) -> Surface:
    """The die as its file holds it."""
    body = die.plain.body
    assert body.triangles is not None
    return Surface(body.points, body.triangles)


@lru_cache(maxsize=1)
def shell_of(die: FinishedDie) -> Shell:
    """Its hull, with the facets tinted that it rests on."""
    hull = die.plain.poses.hull
    of_facet = np.full(len(hull.normals), -1, dtype=np.int64)
    of_facet[die.plain.poses.facets] = die.plain.outcomes.outcome_of_rest
    # A facet of n corners is a fan of n - 2 triangles.
    of_triangle = np.repeat(of_facet, np.diff(hull.facet_start) - 2)
    return Shell(hull.vertices, hull.triangles, outcome_tints(of_triangle))


def cameras_around(die: FinishedDie) -> list[Camera]:
    """Three cameras around the die."""
    return three_cameras(die.plain.body.points, die.upward)


def surfaces_before_and_after(die: FinishedDie) -> tuple[Floats, Floats, Integers, list[Camera]]:
    """Points (n, 3) of its surface before and after, the triangles (t, 3) of both, and three
    cameras around them. The die must keep the shape of a surface."""
    assert die.reshaped is not None
    before, after = die.reshaped.before.points, die.reshaped.after.points
    cameras = three_cameras(np.concatenate([before, after]), die.upward)
    return before, after, die.reshaped.after.triangles, cameras


def outcome_colors(count: int) -> Floats:
    """(count, 3) red, green and blue of outcomes from 0 to 1; they repeat after twenty."""
    return rgb(repeated(BASINS, count))


def outcome_tints(outcomes: Integers) -> Floats:
    """Tints (h, 3) of a shell whose triangles belong to rests of outcomes (h,), or -1 of none."""
    tints = outcome_colors(int(outcomes.max(initial=0)) + 1)[outcomes]
    tints[outcomes < 0] = np.nan
    return tints
