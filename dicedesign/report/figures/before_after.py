"""The surface before and after it was made into a die."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.scene import surfaces_before_and_after

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["before_after_figure"]

_PIXELS: Final = 400


def before_after_figure(before: Surface, after: Surface, cameras: Sequence[Camera]) -> Paper:
    """A surface above what it was made into, from the same cameras, of which there is at least
    one."""
    pictures, titles = [], []
    for name, surface in (("before", before), ("after", after)):
        pictures += trimmed([render(surface, camera, _PIXELS) for camera in cameras])
        titles += [f"{name}, view {k + 1}" for k in range(len(cameras))]
    return picture_grid(pictures, titles, len(cameras))


def _draw(die: FinishedDie) -> bytes:
    before, after, triangles, cameras = surfaces_before_and_after(die)
    return before_after_figure(Surface(before, triangles), Surface(after, triangles), cameras).png()


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
        draw=_draw,
    )
)
