"""Stage tolerances: what errors of printing do to the odds, and infill."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work

if TYPE_CHECKING:
    from dicedesign.fabricate.die import Assessment
    from dicedesign.fabricate.print_options import PrintOptions
    from dicedesign.gradient.odds_model import OddsModel
    from dicedesign.runtime.arrays import Floats

__all__ = ["find_tolerances"]


def find_tolerances(work: Work) -> None:
    """Say how far the odds of prints are from those of the file, with labels if it has them, and
    what infill does to them if the recipe has some."""
    from dicedesign.fabricate.print_tolerances import (
        OddsSlopes,
        OddsSpread,
        OffPrints,
        print_tolerances,
    )
    from dicedesign.geometry.meshes.body import make_body
    from dicedesign.rest.outcomes import outcome_odds
    from dicedesign.rest.poses import analyse

    verdict, target = _printed(work), work.target.probabilities
    model, is_thrown = _odds_model(work), work.recipe.method.thrown
    body, poses, outcomes = verdict.body, verdict.poses, verdict.outcomes
    core = None if work.engraved is None else work.engraved.core
    if work.recipe.edges is not None and core is not None:
        # What rounds an edge moves with the facets beside it, which the core has alone, and with
        # the finished die's center of mass its odds too.
        body = make_body(core.vertices, core.triangles)
        poses = analyse(core, poses.center_of_mass, poses.center_of_mass_source)
        poses = poses.under(work.die.prior)
        outcomes = outcome_odds(poses, work.die.directions)
    slopes = OddsSlopes.of(body, poses, outcomes, model)
    options = work.recipe.print
    assert options is not None
    has_planes = work.die.reshaped is None
    spread = OddsSpread(slopes, options.expected_errors, has_planes, _axes(work))
    # The odds of throws are known from counts alone: what they lack is in doubt.
    bias = np.zeros(len(target)) if is_thrown else verdict.outcomes.odds - target
    prints = None
    if not is_thrown:
        # The momentum model jumps where a corner of several facets falls apart, which dice do not.
        prints = OffPrints(poses, work.die.directions, has_planes, model)
    work.tolerances = print_tolerances(spread, target, bias, prints)
    if options.infill < 1.0:
        _find_infill(work, options, verdict)


def _bounds_one_body(work: Work) -> bool:
    """Whether the file that is printed has an inside: of one that meets itself slicers decide."""
    found = work.printability
    return found is not None and found.file.self_intersections == 0


STAGES.register(
    Stage(
        name="tolerances",
        line="finds what errors of printing, and infill, do to the odds",
        rank=74,
        wanted=_bounds_one_body,
        run=find_tolerances,
    )
)


def _printed(work: Work) -> Assessment:
    engraved = None if work.engraved is None else work.engraved.assessment
    return engraved or work.plain


def _odds_model(work: Work) -> OddsModel | None:
    """The model of the odds that the die is designed for, if it is to be thrown or let go under a
    prior."""
    from dicedesign.gradient.odds_model import odds_model
    from dicedesign.recipe.methods.exact import exact_options

    is_thrown = work.recipe.method.thrown
    return odds_model(exact_options(work.recipe).thrown_onto if is_thrown else None, work.die.prior)


def _axes(work: Work) -> Floats | None:
    """Axes of the printer where the die lies on its bed as is best; None for those of the file."""
    found = work.printability
    return None if found is None else np.array(found.placement)[:3, :3]


def _find_infill(work: Work, options: PrintOptions, verdict: Assessment) -> None:
    from dicedesign.fabricate.engraving import cut_sections
    from dicedesign.fabricate.infill import infill_odds, inside_walls, pocket_walls
    from dicedesign.geometry.solid import solid_properties

    engrave = work.recipe.engrave
    unknown = None
    if work.die.reshaped is not None:
        unknown = "that keeps the shape of a surface"
    elif work.solid.center_of_mass is not None:
        unknown = "whose center of mass is given"
    elif engrave is not None and engrave.balance == "opposite" and verdict is not work.plain:
        unknown = "whose hidden hollow has walls of its own"
    if unknown is not None:
        work.notes.append(
            f"what infill does to a die {unknown} is not computed: its odds are those of 100 %"
        )
        return
    pockets = []
    if verdict is not work.plain and work.engraved is not None and engrave is not None:
        # Labels that were stretched along with the die may run into their borders by more.
        cut = cut_sections(verdict.poses.hull, work.engraved.placements, engrave, joined=1.0)
        pockets = pocket_walls(cut, engrave.depth_mm, options.walls_mm)
    assert verdict.body.triangles is not None
    volume, _ = solid_properties(verdict.body.points, verdict.body.triangles)
    inside = inside_walls(verdict.poses.hull, options.walls_mm, pockets)
    found = infill_odds(
        verdict, work.die.directions, volume, inside, options.infill, options.walls_mm
    )
    work.infill = found
    work.notes.append(found.advice)
