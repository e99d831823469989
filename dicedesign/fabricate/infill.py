"""Odds of a print with infill, and how much of it is enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.fabricate.die import Assessment
from dicedesign.fabricate.print_tolerances import NOTICED, ROLLS
from dicedesign.geometry.hulls.hull import (
    ConvexHull,
    convex_hull,
    deepest_point,
    polyhedron_corners,
)
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import solid_properties
from dicedesign.rest.outcomes import OutcomeOdds, outcome_odds
from dicedesign.rest.poses import analyse
from dicedesign.results.result import InfillOdds
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.goodness_of_fit import LEVEL, chances_noticed

if TYPE_CHECKING:
    from manifold3d import CrossSection, Manifold

    from dicedesign.fabricate.label_layout import Placement


@dataclass(frozen=True, eq=False)
class Inside:
    """The part of a print that is infill.

    Attributes
    ----------
    volume: in mm3, 0 where the walls meet.
    centroid: (3,), anything then.
    """

    volume: float
    centroid: Floats


def inside_walls(hull: ConvexHull, walls_mm: float, pockets: Sequence[Manifold] = ()) -> Inside:
    """What walls leave of a convex body: its half-spaces, moved inward.

    walls_mm: above 0; pockets: solids that are not infill either, from `pocket_walls`.
    """
    middle = hull.centroid
    depths = hull.heights(middle)
    if depths.min() <= walls_mm:
        move, _ = deepest_point(hull.normals, depths)
        depths, middle = depths - hull.normals @ move, middle + move
    if depths.min() <= walls_mm:
        return Inside(0.0, middle)
    inner = convex_hull(middle + polyhedron_corners(hull.normals, depths - walls_mm))
    points, triangles = inner.vertices, inner.triangles
    if pockets:
        from manifold3d import Manifold, OpType

        from dicedesign.geometry.meshes.manifold import mesh_of, solid

        left = Manifold.batch_boolean([solid(points, triangles), *pockets], OpType.Subtract)
        if not left.volume() > 0.0:
            return Inside(0.0, middle)
        points, triangles = mesh_of(left)
    return Inside(*solid_properties(points, triangles))


def pocket_walls(
    sections: Sequence[tuple[Placement, CrossSection]], depth_mm: float, walls_mm: float
) -> list[Manifold]:
    """The walls around pockets, as solids that reach from outside of the facet to below the
    pocket's floor. Their lower rims are square where those of slicers may be round.

    sections: of the pockets, from `cut_sections`; depth_mm: of them.
    """
    from manifold3d import JoinType

    solids = []
    for placement, section in sections:
        deep = depth_mm + walls_mm
        block = section.offset(walls_mm, JoinType.Round).extrude(2.0 * deep)
        solids.append(block.translate((0.0, 0.0, -deep)).transform(placement.frame[:3]))
    return solids


def weighed(volume: float, centroid: Floats, inside: Inside, infill: float) -> tuple[float, Floats]:
    """Mass of a print over that of the solid one, and its center of mass (3,).

    volume, centroid: of the outer body, labels cut in where it has them; infill: 0 to 1.
    """
    missing = (1.0 - infill) * inside.volume
    mass = volume - missing
    return mass / volume, (volume * centroid - missing * inside.centroid) / mass


STEPS: Final = 20
"""Infills that are tried, up to 100 %."""

LEAST_MASS: Final = 1e-3
"""Part of the solid's mass below which none is tried: little is known of where the center of mass
of next to nothing is."""


def infill_odds(
    verdict: Assessment,
    directions: Floats,
    volume: float,
    inside: Inside,
    infill: float,
    walls_mm: float,
) -> InfillOdds:
    """What a die does when it is printed with infill.

    Parameters
    ----------
    verdict: on the file of the uniform solid.
    directions: (k, 3) down in the outcomes.
    volume: of that solid in mm3.
    inside: what the walls leave of it.
    infill: part of the inside that is material, 0 to 1; walls_mm: thickness of the walls.
    """

    def printed(part: float) -> tuple[float, Floats, OutcomeOdds]:
        mass, center = weighed(volume, verdict.poses.center_of_mass, inside, part)
        poses = analyse(verdict.poses.hull, center).under(verdict.poses.prior)
        return mass, center, outcome_odds(poses, directions)

    def weighs(part: float) -> bool:
        return volume - (1.0 - part) * inside.volume >= LEAST_MASS * volume

    def is_noticed(part: float) -> bool:
        solid = verdict.outcomes.odds
        shown = solid > 0.0
        odds = solid[shown] / solid[shown].sum()
        change = printed(part)[2].odds[shown] - solid[shown]
        return bool(chances_noticed(odds, ROLLS, change[None])[0] > NOTICED)

    least = STEPS
    while least > 0 and weighs((least - 1) / STEPS) and not is_noticed((least - 1) / STEPS):
        least -= 1
    mass, center, outcomes = printed(infill)
    shift = center - verdict.poses.center_of_mass
    changes = np.abs(outcomes.odds - verdict.outcomes.odds)
    told = (
        f"At {100.0 * infill:.0f} % infill with walls of {walls_mm:g} mm the die has "
        f"{100.0 * mass:.0f} % of its mass, its center of mass moves by "
        f"{norms(shift):.2g} mm, and the odds of {verdict.target.labels[int(changes.argmax())]} "
        f"change most, by {changes.max():.2g}: "
    )
    test = f"a chi-square test at {100.0 * LEVEL:.0f} % of {ROLLS:,} rolls"
    if is_noticed(infill):
        enough = "" if least == STEPS else f", or with {100.0 * least / STEPS:.0f} % or more"
        advice = f"{test} notices. Print it solid, at 100 % infill{enough}."
    else:
        advice = f"{test} does not notice. Print it so, or solid."
    return InfillOdds(
        infill=infill,
        walls_mm=walls_mm,
        advice=told + advice,
        probabilities=tuple(outcomes.odds.tolist()),
        elsewhere=outcomes.elsewhere,
        max_abs_error=outcomes.max_abs_error(verdict.target.probabilities),
        mass=mass,
        shift_mm=tuple(shift.tolist()),
        least_infill=least / STEPS,
    )
