"""A designed die, the same kind whatever method designed it, and its solid in millimetres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.rest.outcomes import OutcomeOdds, outcome_odds
from dicedesign.rest.poses import RestPoses, analyse, rest_poses
from dicedesign.results.record import HullsMade, Step
from dicedesign.results.status import Status
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.concave.result import ConcaveDie
    from dicedesign.optimize.refinement.rounds import Round
    from dicedesign.rest.prior import Prior

__all__ = ["DesignedDie", "SizedDie", "sized"]


@dataclass(frozen=True, eq=False)
class DesignedDie:
    """What every method returns. Lengths are in a unit of the design's own.

    Attributes
    ----------
    status: why the method stopped.
    hull: the designed convex hull.
    directions: (k, 3) down in the outcomes, in the order of the target.
    error: largest |p - q| by the odds that the method is about.
    steps: every accepted one, the first being the start.
    center_of_mass: (3,) that was given, or None for the uniform solid.
    terms: of the energy at the end, by name.
    starts: starting shapes that were tried; evaluations: dice; hulls: computed for them.
    rounds: of throws and new designs.
    reshaped: the surface before and after, of a die that keeps the shape of one; else None.
    prior: that the odds are under, or None where any side is down alike at first.
    """

    status: Status
    hull: ConvexHull
    directions: Floats
    error: float
    steps: tuple[Step, ...]
    center_of_mass: Floats | None = None
    terms: Mapping[str, float] | None = None
    starts: int | None = None
    evaluations: int | None = None
    hulls: HullsMade | None = None
    rounds: tuple[Round, ...] = ()
    reshaped: ConcaveDie | None = None
    prior: Prior | None = None


@dataclass(frozen=True, eq=False)
class SizedDie:
    """The solid of a die in mm, before coordinates are rounded to those of a file, with its center
    of mass at the origin.

    Attributes
    ----------
    points: (n, 3); triangles: (t, 3) counter-clockwise seen from outside.
    poses: its rests; outcomes: what they count for.
    center_of_mass: (3,) zeros where it was given, or None for the uniform solid.
    hull_points: (v, 3) corners of the designed hull there.
    changes: made for printing, one sentence each.
    is_printable: whether the surface could be cleaned for printing.
    """

    points: Floats
    triangles: Integers
    poses: RestPoses
    outcomes: OutcomeOdds
    center_of_mass: Floats | None
    hull_points: Floats
    changes: tuple[str, ...] = ()
    is_printable: bool = True


def sized(die: DesignedDie, size_mm: float) -> SizedDie:
    """A die of a largest distance `size_mm`, positive, between two of its points."""
    if die.reshaped is not None:
        return _sized_surface(die, die.reshaped, size_mm)
    given = die.center_of_mass
    center = die.hull.centroid if given is None else given
    hull = convex_hull((die.hull.vertices - center) * (size_mm / die.hull.diameter))
    if given is None:
        poses = analyse(hull, hull.centroid, "uniform solid")
    else:
        poses = analyse(hull, np.zeros(3), "given")
    poses = poses.under(die.prior)
    return SizedDie(
        points=hull.vertices,
        triangles=hull.triangles,
        poses=poses,
        outcomes=outcome_odds(poses, die.directions),
        center_of_mass=None if given is None else np.zeros(3),
        hull_points=hull.vertices,
    )


def _sized_surface(die: DesignedDie, made: ConcaveDie, size_mm: float) -> SizedDie:
    # It brings a library of solids along, which no convex die needs.
    from dicedesign.fabricate.printable_solid import printable_solid
    from dicedesign.geometry.surfaces.surface import Surface

    hollow = made.hollow
    center = made.after.centroid if hollow is None else hollow.center_of_mass
    scale = size_mm / convex_hull(made.after.points).diameter
    placed = made.after.moved((made.after.points - center) * scale)
    points, triangles, is_printable = placed.points, placed.triangles, True
    try:
        points, triangles, changes = printable_solid(placed)
        if hollow is not None:
            from dicedesign.fabricate.solids.hollow import with_cavity

            whole = with_cavity(Surface(points, triangles), hollow.wall * size_mm, np.zeros(3))
            points, triangles = whole.points, whole.triangles
    except InputError as error:
        # Then the die is written as it is, and says so.
        is_printable, changes = False, (str(error),)
    poses = rest_poses(make_body(points, triangles))
    return SizedDie(
        points=points,
        triangles=triangles,
        poses=poses,
        outcomes=outcome_odds(poses, die.directions),
        center_of_mass=None,
        hull_points=(die.hull.vertices - center) * scale,
        changes=changes,
        is_printable=is_printable,
    )
