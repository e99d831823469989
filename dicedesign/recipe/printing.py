"""Stages printing and tolerances: what the printer will not make, how the die lies best on its bed,
and what errors of printing, and infill, do to the odds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dicedesign.fabricate.die import Assessment
from dicedesign.fabricate.infill import infill_odds, inside_walls, pocket_walls
from dicedesign.fabricate.print_options import PrintOptions
from dicedesign.fabricate.print_tolerances import (
    OddsSlopes,
    OddsSpread,
    OffPrints,
    print_tolerances,
)
from dicedesign.fabricate.printability import PrintedDie, printability
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.formats import parsed_stl, stl_bytes
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.gradient.odds_model import odds_model
from dicedesign.recipe.work import Work
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse, rest_poses


def prepare_print(work: Work) -> None:
    """Judge the file that is printed, and make die_oriented.stl where it is wanted."""
    options, engraving, made = work.recipe.print, work.recipe.engrave, work.engraved
    assert options is not None
    body = _printed(work)
    poses = work.plain.poses
    if made is not None:
        # Of the rounded body too, where the center of mass was given.
        given = work.solid.center_of_mass
        poses = rest_poses(body, given) if made.assessment is None else made.assessment.poses
    placements = () if made is None else made.placements
    labels = tuple(placement.text for placement in placements)
    normals = np.array([placement.frame[:3, 2] for placement in placements]).reshape(-1, 3)
    if made is not None and work.die.reshaped is not None:
        # Marks are on the side that is up.
        labels, normals = work.target.labels, -work.plain.poses.normals[work.plain.outcomes.main]
    die = PrintedDie(
        body=body,
        poses=poses,
        designed=convex_hull(work.solid.hull_points) if work.die.reshaped is None else None,
        shape=_shape(work),
        labels=labels,
        normals=normals,
        placements=placements,
        depth=0.0 if engraving is None else engraving.depth_mm,
        raised=engraving is not None and engraving.style == "raised",
        filling_mm3=0.0 if made is None or made.inlay is None else made.inlay.volume,
    )
    found = printability(die, options)
    work.printability = found
    work.notes += found.warnings
    if options.oriented:
        assert body.triangles is not None
        placement = np.array(found.placement)
        points = body.points @ placement[:3, :3].T + placement[:3, 3]
        work.files["die_oriented.stl"] = stl_bytes(points, body.triangles)


def _shape(work: Work) -> Surface | None:
    """The die without labels, read back, where it keeps the shape of a surface and is a solid."""
    body = work.plain.body
    if work.die.reshaped is None or not work.solid.is_printable:
        return None
    assert body.triangles is not None
    return Surface(body.points, body.triangles)


def _printed(work: Work) -> Body:
    """The file that is printed, read back."""
    if work.engraved is None:
        return work.plain.body
    points, triangles = parsed_stl(work.files["die.stl"], Path("die.stl"))
    return make_body(points, triangles, "die.stl", single_precision=True)


def find_tolerances(work: Work) -> None:
    """Say how far the odds of prints are from those of the file, with labels if it has them, and
    what infill does to them if the recipe has some."""
    verdict, target = work.printed, work.target.probabilities
    table = work.recipe.method.table
    model = odds_model(table, work.die.prior)
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
    assert work.printability is not None
    # Of the printer where the die lies on its bed as is best.
    axes = np.array(work.printability.placement)[:3, :3]
    spread = OddsSpread(slopes, options.expected_errors, has_planes, axes)
    # The odds of throws are known from counts alone: what they lack is in doubt.
    bias = np.zeros(len(target)) if table else verdict.outcomes.odds - target
    prints = None
    if table is None:
        # The momentum model jumps where a corner of several facets falls apart, which dice do not.
        prints = OffPrints(poses, work.die.directions, has_planes, model)
    work.tolerances = print_tolerances(spread, target, bias, prints)
    if options.infill < 1.0:
        _find_infill(work, options, verdict)


def _find_infill(work: Work, options: PrintOptions, verdict: Assessment) -> None:
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
        # It brings a library of solids along.
        from dicedesign.fabricate.engraving import cut_sections

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
