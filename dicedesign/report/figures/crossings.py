"""Where the surface of a die meets itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.scene import surfaces_before_and_after
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["crossings_figure"]

_PIXELS: Final = 400

_PALE: Final = (0.82, 0.80, 0.76)

_CROSSING: Final = (0.80, 0.10, 0.10)


def crossings_figure(
    points: Floats, triangles: Integers, pairs: Integers, cameras: Sequence[Camera]
) -> Paper:
    """A surface with the triangles that meet in red.

    points: (n, 3); triangles: (t, 3); pairs: (m, 2) numbers of triangles that meet and should not;
    cameras: at least one.
    """
    colors = np.full(points.shape, _PALE)
    colors[np.unique(triangles[np.unique(pairs)])] = _CROSSING
    surface = Surface(points, triangles, colors)
    pictures = trimmed([render(surface, camera, _PIXELS) for camera in cameras])
    return picture_grid(pictures, [f"view {k + 1}" for k in range(len(cameras))], len(cameras))


def _draw(die: FinishedDie) -> bytes:
    assert die.quality is not None
    _, after, triangles, cameras = surfaces_before_and_after(die)
    return crossings_figure(after, triangles, die.quality.intersections, cameras).png()


FIGURES.register(
    Figure(
        name="crossings",
        line="where the surface meets itself",
        rank=35,
        title="Where the surface meets itself",
        caption="In red the triangles that meet and should not.",
        wanted=lambda die: die.quality is not None and len(die.quality.intersections) > 0,
        draw=_draw,
    )
)
