"""Stage printing: what the printer will not make, and how the die lies best on its bed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work

if TYPE_CHECKING:
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["prepare_print"]


def prepare_print(work: Work) -> None:
    """Judge the file that is printed, and make die_oriented.stl where it is wanted."""
    from dicedesign.fabricate.printability import PrintedDie, printability
    from dicedesign.geometry.hulls.hull import convex_hull
    from dicedesign.geometry.meshes.formats import stl_bytes
    from dicedesign.rest.poses import rest_poses

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


STAGES.register(
    Stage(
        name="printing",
        line="says what the printer will not make and how the die lies best on its bed; makes "
        "die_oriented.stl",
        rank=72,
        wanted=lambda work: work.recipe.print is not None,
        run=prepare_print,
    )
)


def _shape(work: Work) -> Surface | None:
    """The die without labels, read back, where it keeps the shape of a surface and is a solid."""
    from dicedesign.geometry.surfaces.surface import Surface

    body = work.plain.body
    if work.die.reshaped is None or not work.solid.is_printable:
        return None
    assert body.triangles is not None
    return Surface(body.points, body.triangles)


def _printed(work: Work) -> Body:
    """The file that is printed, read back."""
    from dicedesign.geometry.meshes.body import make_body
    from dicedesign.geometry.meshes.formats import parsed_stl

    if work.engraved is None:
        return work.plain.body
    points, triangles = parsed_stl(work.files["die.stl"], Path("die.stl"))
    return make_body(points, triangles, "die.stl", single_precision=True)
