"""The surface before and after it was made into a die."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.scene import surfaces_before_and_after
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["before_after_figure"]

_PIXELS: Final = 400


def before_after_figure(
    before: Floats, after: Floats, triangles: Integers, cameras: Sequence[Camera]
) -> Paper:
    """A surface above what it was deformed into, from the same cameras.

    before, after: (n, 3) in one length unit; triangles: (t, 3) of both, oriented alike; cameras: at
    least one.
    """
    pictures, titles = [], []
    for name, points in (("before", before), ("after", after)):
        surface = Surface(points, triangles)
        pictures += trimmed([render(surface, camera, _PIXELS) for camera in cameras])
        titles += [f"{name}, view {k + 1}" for k in range(len(cameras))]
    return picture_grid(pictures, titles, len(cameras))


FIGURES.register(
    Figure(
        name="before_after",
        line="the surface before and after it was made into a die",
        rank=15,
        title="Before and after",
        caption=(
            "The surface as it came, above, and as it was made into a die, below; all views have "
            "the same scale."
        ),
        wanted=lambda die: die.reshaped is not None,
        draw=lambda die: before_after_figure(*surfaces_before_and_after(die)).png(),
    )
)
