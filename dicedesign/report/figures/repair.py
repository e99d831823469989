"""A mesh before and after it was repaired."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.geometry.triangles import edge_keys
from dicedesign.report.charts.palette import rgb
from dicedesign.report.charts.paper import Paper
from dicedesign.report.figures.before_after import before_after_figure
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.cameras import three_cameras
from dicedesign.report.render.renderer import Surface
from dicedesign.report.render.shading import MATERIAL
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.geometry.repair.repair import RepairedMesh

__all__ = ["repair_figure"]

_FAULT: Final = "#c0392b"


def repair_figure(repaired: RepairedMesh, up: Floats) -> Paper:
    """The triangles as they came above the surface made of them, from the same cameras; corners of
    edges that are not of two triangles are red.

    up: (3,) upward in the pictures.
    """
    triangles = repaired.triangles
    colors = np.tile(MATERIAL.astype(np.float64), (len(repaired.points), 1))
    colors[_faulty_points(triangles)] = rgb([_FAULT])[0]
    before = Surface(repaired.points, triangles, colors)
    surface = repaired.surface
    plain = np.tile(MATERIAL.astype(np.float64), (len(surface.points), 1))
    after = Surface(surface.points, surface.triangles, plain)
    cameras = three_cameras(np.concatenate([before.points, after.points]), up)
    return before_after_figure(before, after, cameras)


def _faulty_points(triangles: Integers) -> Integers:
    """The points on edges of triangles (t, 3) that are of one triangle or more than two."""
    _, edge, uses = np.unique(edge_keys(triangles), return_inverse=True, return_counts=True)
    faulty = (uses != 2)[edge]
    return np.union1d(triangles.ravel()[faulty], np.roll(triangles, -1, axis=1).ravel()[faulty])


def _draw(die: FinishedDie) -> bytes:
    assert die.repaired is not None
    return repair_figure(die.repaired, die.upward).png()


FIGURES.register(
    Figure(
        name="repair",
        line="a mesh before and after it was repaired",
        rank=12,
        title="Repair",
        caption=(
            "The mesh as it came, above, red at edges that are not of two triangles, and the "
            "surface that was made of it, below; all views have the same scale."
        ),
        wanted=lambda die: die.repaired is not None,
        draw=_draw,
    )
)
