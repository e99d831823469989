"""Effect of sparse infill on the probabilities of a die: solid walls, and an inside with a share of
the material.

Lengths are in millimeters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dicedesign.fabricate.die import Assessment
from dicedesign.fabricate.print_copies import NOTICED, ROLLS
from dicedesign.geometry.hulls.hull import (
    ConvexHull,
    convex_hull,
    deepest_point,
    polyhedron_corners,
)
from dicedesign.geometry.sphere import norms
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_probabilities
from dicedesign.rest.poses import analyze
from dicedesign.results.result import InfillProbabilities
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.goodness_of_fit import LEVEL, chances_noticed

if TYPE_CHECKING:
    from manifold3d import CrossSection, Manifold

    from dicedesign.fabricate.label_layout import Placement

STEPS = 20
"""Number of infills up to 100 % among which the least one is searched."""

LEAST_MASS = 1e-3
"""Least mass of a print in that search, over the solid's: the center of mass of hardly any material
is uncertain."""

Inside: TypeAlias = tuple[float, Floats]
"""Volume in mm3 and centroid (3,) of the part of a print that is infill. Where walls leave none the
volume is 0 and the centroid arbitrary."""


def inside_walls(hull: ConvexHull, walls_mm: float, pockets: Sequence[Manifold] = ()) -> Inside:
    """Inside of the walls of a convex body: its half-spaces, moved inward.

    walls_mm: above 0; pockets: solids without infill, from `pocket_walls`.
    """
    middle = hull.centroid
    depths = hull.heights(middle)
    if depths.min() <= walls_mm:
        move, _ = deepest_point(hull.normals, depths)
        depths, middle = depths - hull.normals @ move, middle + move
    if depths.min() <= walls_mm:
        return 0.0, middle
    inner = convex_hull(middle + polyhedron_corners(hull.normals, depths - walls_mm))
    core = inner.surface
    if pockets:
        from manifold3d import Manifold, OpType

        from dicedesign.geometry.meshes.manifold import mesh_of, solid

        left = Manifold.batch_boolean([solid(core), *pockets], OpType.Subtract)
        if not left.volume() > 0.0:
            return 0.0, middle
        core = mesh_of(left)
    return core.volume, core.centroid


def pocket_walls(
    sections: Sequence[tuple[Placement, CrossSection]], depth_mm: float, walls_mm: float
) -> list[Manifold]:
    """Walls around pockets, as solids that reach from outside of the facet to below the pocket's
    floor. Their lower rims are square; slicers may round them.

    sections: of the pockets, from `cut_sections`; depth_mm: of those with a share of 1.
    """
    from manifold3d import JoinType

    walls = []
    for placement, section in sections:
        deep = depth_mm * placement.depth_share + walls_mm
        around = section.offset(walls_mm, JoinType.Round)
        walls.append(placement.sink(around, deep, 2.0 * deep))
    return walls


def weigh_print(
    volume: float, centroid: Floats, inside: Inside, infill: float
) -> tuple[float, Floats]:
    """Mass of a print over the mass of a solid print, and its center of mass (3,).

    volume, centroid: of the solid, with its labels cut in; infill: 0 to 1.
    """
    missing = (1.0 - infill) * inside[0]
    mass = volume - missing
    return mass / volume, (volume * centroid - missing * inside[1]) / mass


def infill_probabilities(
    verdict: Assessment,
    directions: Floats,
    volume: float,
    inside: Inside,
    infill: float,
    walls_mm: float,
) -> InfillProbabilities:
    """Probabilities of a die printed with infill.

    Parameters
    ----------
    verdict: assessment of the file of the uniform solid.
    directions: (f, 3) down on the labeled faces.
    volume: of the solid in mm3.
    inside: of its walls.
    infill: share of the inside that is material, 0 to 1; walls_mm: thickness of the walls.
    """
    poses, solid = verdict.poses, verdict.outcomes.probabilities
    shown = solid > 0.0

    def assess(share: float) -> tuple[float, Floats, OutcomeProbabilities, bool]:
        """Mass, center of mass, probabilities, and whether the test notices them."""
        mass, center = weigh_print(volume, poses.center_of_mass, inside, share)
        at_center = analyze(poses.hull, center).under(poses.prior)
        of_face = verdict.target.outcome_of_face
        outcomes = outcome_probabilities(at_center, directions, of_face)
        change = outcomes.probabilities[shown] - solid[shown]
        chances = chances_noticed(solid[shown] / solid[shown].sum(), ROLLS, change[None])
        return mass, center, outcomes, bool(chances[0] > NOTICED)

    least = STEPS
    while least > 0:
        share = (least - 1) / STEPS
        if volume - (1.0 - share) * inside[0] < LEAST_MASS * volume or assess(share)[3]:
            break
        least -= 1
    mass, center, outcomes, is_noticed = assess(infill)
    shift = center - poses.center_of_mass
    changes = np.abs(outcomes.probabilities - solid)
    advice = (
        f"At {100.0 * infill:.0f} % infill with walls of {walls_mm:g} mm the die has "
        f"{100.0 * mass:.0f} % of its mass, its center of mass moves by {norms(shift):.2g} mm, and "
        f"the probabilities of {verdict.target.labels[int(changes.argmax())]} change most, by "
        f"{changes.max():.2g}: a chi-square test at {100.0 * LEVEL:.0f} % of {ROLLS:,} rolls "
    )
    if is_noticed:
        enough = "" if least == STEPS else f", or with {100.0 * least / STEPS:.0f} % or more"
        advice += f"notices. Print it solid, at 100 % infill{enough}."
    else:
        advice += "does not notice. Print it so, or solid."
    return InfillProbabilities(
        infill=infill,
        walls_mm=walls_mm,
        advice=advice,
        probabilities=tuple(outcomes.probabilities.tolist()),
        elsewhere=outcomes.elsewhere,
        max_abs_error=outcomes.max_abs_error(verdict.target.probabilities),
        mass=mass,
        shift_mm=tuple(shift.tolist()),
        least_infill=least / STEPS,
    )
