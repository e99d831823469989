"""A surface before and after its deformation, and within its convex hull."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from dicedesign.report.charts.palette import BASINS, DARK
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import PaintedSurface, Shell, render_surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = [
    "before_after_figure",
    "crossings_figure",
    "hull_overlay_figure",
    "outcome_colors",
    "outcome_tints",
]

_PIXELS: Final = 400

_PALE: Final = (0.82, 0.80, 0.76)

_CROSSING: Final = (0.80, 0.10, 0.10)

_LEGEND_ROW: Final = 0.26

_LEGEND_COLUMNS: Final = 10


def before_after_figure(
    before: Floats, after: Floats, triangles: Integers, cameras: Sequence[Camera]
) -> Figure:
    """A surface above what it was deformed into, from the same cameras.

    before, after: (n, 3) in one length unit; triangles: (t, 3) of both, oriented alike; cameras: at
    least one.
    """
    pictures, titles = [], []
    for name, points in (("before", before), ("after", after)):
        surface = PaintedSurface(points, triangles)
        pictures += trimmed([render_surface(surface, camera, _PIXELS) for camera in cameras])
        titles += [f"{name}, view {k + 1}" for k in range(len(cameras))]
    return picture_grid(pictures, titles, len(cameras))


def crossings_figure(
    points: Floats, triangles: Integers, pairs: Integers, cameras: Sequence[Camera]
) -> Figure:
    """A surface with the triangles that meet in red.

    points: (n, 3); triangles: (t, 3); pairs: (m, 2) numbers of triangles that meet and should not;
    cameras: at least one.
    """
    colors = np.full(points.shape, _PALE)
    colors[np.unique(triangles[np.unique(pairs)])] = _CROSSING
    surface = PaintedSurface(points, triangles, colors)
    pictures = trimmed([render_surface(surface, camera, _PIXELS) for camera in cameras])
    return picture_grid(pictures, [f"view {k + 1}" for k in range(len(cameras))], len(cameras))


def hull_overlay_figure(
    surface: PaintedSurface, shell: Shell, labels: Sequence[str], cameras: Sequence[Camera]
) -> Figure:
    """A surface within its convex hull, with the facets of the hull that it rests on coloured.

    surface: what to draw; shell: its hull, with the tints that `outcome_tints` gives; labels: k
    outcomes, at least one; cameras: at least one.
    """
    pictures = trimmed([render_surface(surface, camera, _PIXELS, shell) for camera in cameras])
    titles = [f"view {k + 1}" for k in range(len(cameras))]
    columns = min(_LEGEND_COLUMNS, len(labels))
    below = _LEGEND_ROW * math.ceil(len(labels) / columns)
    figure = picture_grid(pictures, titles, len(cameras), below=below)
    colors = outcome_colors(len(labels))
    legend = figure.legend(
        [Patch(facecolor=color, edgecolor=DARK, linewidth=0.5) for color in colors],
        labels,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.06 / figure.get_figheight()),
        ncols=columns,
        fontsize=10,
        labelcolor=DARK,
        frameon=False,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)
    return figure


def outcome_colors(count: int) -> Floats:
    """(count, 3) red, green and blue of outcomes from 0 to 1; they repeat after twenty."""
    colors = np.array([to_rgb(color) for color in BASINS])
    return colors[np.arange(count) % len(colors)]


def outcome_tints(outcomes: Integers) -> Floats:
    """Tints (h, 3) of a shell whose triangles belong to rests of outcomes (h,), or -1 of none."""
    tints = outcome_colors(int(outcomes.max(initial=0)) + 1)[outcomes]
    tints[outcomes < 0] = np.nan
    return tints
