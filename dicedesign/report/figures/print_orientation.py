"""The die as it is best printed, on the bed, and what needs supports."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.cameras import framed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.report.render.shadow import shadowed_table
from dicedesign.runtime.arrays import Booleans, Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["print_orientation_figure"]

_PIXELS: Final = 400

_HANGING: Final = (0.87, 0.35, 0.22)

_TOUCHING: Final = (0.42, 0.60, 0.80)

_SIDE: Final = (1.0, -0.8, 0.55)

_UP: Final = np.array([0.0, 0.0, 1.0])


def print_orientation_figure(
    points: Floats, triangles: Integers, hanging: Booleans, touching: Booleans
) -> Paper:
    """A solid on the bed z = 0, from the side and from beneath.

    points: (n, 3) in any length unit, none of them below the bed; triangles: (t, 3); hanging,
    touching: (t,) those that need supports, and those on the bed, which are coloured.
    """
    beside = Camera(np.array(_SIDE), _UP, np.zeros(3), 1.0)
    beneath = Camera(-_UP, np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.0)
    shadow = points * (1.0, 1.0, 0.0)
    beside, beneath = framed([beside, beneath], [np.concatenate([points, shadow]), points])
    # Each triangle has corners of its own, for a colour of its own.
    colors = np.where(touching[:, None], _TOUCHING, MATERIAL.astype(np.float64))
    colors = np.where(hanging[:, None], _HANGING, colors).repeat(3, axis=0)
    corners = points[triangles].reshape(-1, 3)
    colored = Surface(corners, np.arange(len(corners)).reshape(-1, 3), colors, smooth=False)
    # From beside nothing is coloured where nothing hangs over.
    solid = colored if hanging.any() else Surface(points, triangles, smooth=False)
    heights = points[:, 2].clip(0.0)
    table = shadowed_table(points, triangles, heights, _UP, beside, _PIXELS, beside.half_width)
    pictures = [
        render(solid, beside, _PIXELS, backdrop=table),
        render(colored, beneath, _PIXELS),
    ]
    return picture_grid(trimmed(pictures), ["on the bed", "from beneath"], 2)


def _draw(die: FinishedDie) -> bytes:
    from dicedesign.fabricate.print_orientation import ON_BED, PrintedSolid
    from dicedesign.fabricate.printers import PRINTERS

    found = die.result.printability
    assert found is not None
    solid = die.plain.body if die.engraved is None else die.engraved
    assert solid.triangles is not None
    judged = die.plain if die.engraved is None else die.engraved.assessment or die.plain
    hull = judged.poses.hull if die.reshaped is None else None
    printed = PrintedSolid(solid.points, solid.triangles, hull, (), np.zeros((0, 3)))
    placement, down = np.array(found.placement), np.array([found.best.normal])
    printer = replace(PRINTERS[found.printer], layer_mm=found.layer_mm)
    points = solid.points @ placement[:3, :3].T + placement[:3, 3]
    return print_orientation_figure(
        points,
        solid.triangles,
        printed.overhanging(down, printer)[:, 0],
        points[solid.triangles][:, :, 2].max(axis=1) < ON_BED,
    ).png()


FIGURES.register(
    Figure(
        name="print_orientation",
        line="the die as it is best printed, and what needs supports",
        rank=65,
        title="How to lay it on the print bed",
        caption="Blue lies on the bed, red needs supports.",
        wanted=lambda die: die.result.printability is not None,
        draw=_draw,
    )
)
