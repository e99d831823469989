"""How far each part of a surface was moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure

from dicedesign.report.charts.palette import DARK
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import PaintedSurface, render_surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["displacement_figure"]

_PIXELS: Final = 400

_COLORS: Final = "magma_r"

_RANGE: Final = (0.04, 0.80)
"""Part of the colours used: on the ends shading could not be seen."""

_ABOVE: Final = 0.28

_BELOW: Final = 0.62

_LEAST_TOP: Final = 1e-9


def displacement_figure(
    before: Floats, after: Floats, triangles: Integers, cameras: Sequence[Camera]
) -> Figure:
    """The surface after its deformation, coloured by how far each point was moved.

    Distances are in percent of the diagonal of the box along the axes that holds the surface
    before; the mean in the title is that over the points.

    before, after: (n, 3) in one length unit; triangles: (t, 3) of both, oriented alike; cameras: at
    least one.
    """
    diagonal = float(np.linalg.norm(np.ptp(before, axis=0)))
    percent = 100.0 * np.linalg.norm(after - before, axis=1) / diagonal
    scale = ScalarMappable(Normalize(0.0, max(float(percent.max()), _LEAST_TOP)), _colors())
    surface = PaintedSurface(after, triangles, np.asarray(scale.to_rgba(percent))[:, :3])
    pictures = trimmed([render_surface(surface, camera, _PIXELS) for camera in cameras])
    titles = [f"after, view {k + 1}" for k in range(len(cameras))]
    figure = picture_grid(pictures, titles, len(cameras), _ABOVE, _BELOW)
    height = figure.get_figheight()
    figure.text(
        0.5,
        1.0 - 0.12 / height,
        f"displacement: mean {percent.mean():.2g} %, largest {percent.max():.2g} % of the diagonal",
        ha="center",
        va="top",
        fontsize=11,
        color=DARK,
    )
    axes = figure.add_axes((0.25, 0.48 / height, 0.5, 0.16 / height))
    bar = figure.colorbar(scale, cax=axes, orientation="horizontal")
    bar.set_label("displacement (% of the diagonal)", fontsize=9, color=DARK, labelpad=2)
    bar.ax.tick_params(labelsize=9, colors=DARK, length=3)
    bar.outline.set_linewidth(0.5)
    return figure


def _colors() -> Colormap:
    """From pale to dark in steps that look equal, also to colour-blind people."""
    return ListedColormap(matplotlib.colormaps[_COLORS](np.linspace(*_RANGE, 256)))
