"""How far each part of a surface was moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart
from dicedesign.report.charts.palette import rgb
from dicedesign.report.charts.paper import TITLE, Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.scene import surfaces_before_and_after
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["displacement_colors", "displacement_figure"]

_PIXELS: Final = 400

_COLORS: Final = (
    "#fdebac",
    "#febf84",
    "#fd9266",
    "#f2645c",
    "#d6456c",
    "#b0357b",
    "#882781",
    "#621980",
    "#3b0f70",
)
"""From pale to dark in steps that look equal, also to colour-blind people: nine of magma, by S. van
der Walt and N. Smith (2015), without its ends, on which shading could not be seen."""

_BAR: Final = (650, 24)
"""Pixels of the bar of colours."""

_LEAST_TOP: Final = 1e-9


def displacement_colors(shares: Floats) -> Floats:
    """(n, 3) red, green and blue from 0 to 1 of shares (n,) of the largest displacement."""
    places, colors = np.linspace(0.0, 1.0, len(_COLORS)), rgb(_COLORS)
    return np.stack([np.interp(shares, places, colors[:, k]) for k in range(3)], axis=1)


def displacement_figure(
    before: Floats, after: Floats, triangles: Integers, cameras: Sequence[Camera]
) -> Paper:
    """The surface after its deformation, coloured by how far each point was moved.

    Distances are in percent of the diagonal of the box along the axes that holds the surface
    before; the mean in the title is that over the points.

    before, after: (n, 3) in one length unit; triangles: (t, 3) of both, oriented alike; cameras: at
    least one.
    """
    diagonal = float(np.linalg.norm(np.ptp(before, axis=0)))
    percent = 100.0 * np.linalg.norm(after - before, axis=1) / diagonal
    top = max(float(percent.max()), _LEAST_TOP)
    surface = Surface(after, triangles, displacement_colors(percent / top))
    pictures = trimmed([render(surface, camera, _PIXELS) for camera in cameras])
    titles = [f"after, view {k + 1}" for k in range(len(cameras))]
    paper = picture_grid(pictures, titles, len(cameras), above=42.0, below=105.0)
    middle = paper.width / 2.0
    paper.text(
        f"displacement: mean {percent.mean():.2g} %, largest {percent.max():.2g} % of the diagonal",
        (middle, 18.0),
        size=TITLE,
        anchor="ma",
    )
    wide, tall = _BAR
    colors = np.rint(255.0 * displacement_colors(np.linspace(0.0, 1.0, wide))).astype(np.uint8)
    left, upper = middle - wide / 2.0, paper.height - 110.0
    paper.picture(np.broadcast_to(colors, (tall, wide, 3)), left, upper)
    scale = Axis(0.0, top, "displacement (% of the diagonal)")
    box = (left, upper, left + wide, upper + tall)
    Chart(box, scale, Axis(0.0, 1.0, ticks=()), grid="").draw(paper)
    return paper


FIGURES.register(
    Figure(
        name="displacement",
        line="how far each part of the surface was moved",
        rank=30,
        title="How far the surface was moved",
        caption=(
            "Distance of each point of the surface from where it was before, relative to the "
            "diagonal of the box that held the surface."
        ),
        wanted=lambda die: die.reshaped is not None,
        draw=lambda die: displacement_figure(*surfaces_before_and_after(die)).png(),
    )
)
