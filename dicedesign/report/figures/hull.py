"""The die within its convex hull."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from dicedesign.report.charts.chart import draw_legend, legend_height
from dicedesign.report.charts.palette import BASINS, repeated
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.charts.series import Band
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Shell, Surface, render
from dicedesign.report.render.scene import cameras_around, shell_of, surface_of

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["hull_figure"]

_PIXELS: Final = 400

_LEGEND_COLUMNS: Final = 10


def hull_figure(
    surface: Surface, shell: Shell, labels: Sequence[str], cameras: Sequence[Camera]
) -> Paper:
    """A surface within its convex hull, with the facets of the hull that it rests on coloured.

    surface: what to draw; shell: its hull, with the tints that `outcome_tints` gives; labels: k
    outcomes, at least one; cameras: at least one.
    """
    pictures = trimmed([render(surface, camera, _PIXELS, shell) for camera in cameras])
    titles = [f"view {k + 1}" for k in range(len(cameras))]
    colors = repeated(BASINS, len(labels))
    keys = [Band(0.0, 0.0, color, label, 1.0) for color, label in zip(colors, labels, strict=True)]
    below = legend_height(keys, _LEGEND_COLUMNS)
    paper = picture_grid(pictures, titles, len(cameras), below=below)
    middle = paper.width / 2.0
    draw_legend(paper, keys, (middle, paper.height - below - 10.0), columns=_LEGEND_COLUMNS)
    return paper


def _draw(die: FinishedDie) -> bytes:
    labels = die.result.labels
    return hull_figure(surface_of(die), shell_of(die), labels, cameras_around(die)).png()


FIGURES.register(
    Figure(
        name="hull",
        line="the die within its convex hull",
        rank=25,
        title="The die within its convex hull",
        caption=(
            "A body rolls like its convex hull, which touches the table. Coloured are the facets "
            "that the die rests on, by outcome; those on the far side are paler."
        ),
        wanted=lambda die: die.reshaped is not None,
        draw=_draw,
    )
)
