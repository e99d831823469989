"""Several solids side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["solids_figure"]

_PIXELS: Final = 340

_SIDE: Final = (1.0, -0.7, 0.5)
"""From where they are seen."""


def solids_figure(groups: Sequence[Sequence[tuple[str, Floats, Integers]]], columns: int) -> Paper:
    """Solids with a title above each, from one side, each as large as fits.

    groups: of solids by title, points (n, 3) and triangles (t, 3), at least one solid in all; each
    group begins a row. columns: of the figure, at least 1.
    """
    pictures, titles = [], []
    blank = np.full((_PIXELS, _PIXELS, 3), 255, dtype=np.uint8)
    for group in groups:
        for title, points, triangles in group:
            center = (points.min(axis=0) + points.max(axis=0)) / 2.0
            radius = 1.03 * float(np.linalg.norm(points - center, axis=1).max())
            camera = Camera(np.array(_SIDE), np.array([0.0, 0.0, 1.0]), center, radius)
            surface = Surface(points, triangles, smooth=False)
            pictures.append(render(surface, camera, _PIXELS))
            titles.append(title)
        lacking = -len(group) % columns
        pictures += [blank] * lacking
        titles += [""] * lacking
    return picture_grid(pictures, titles, columns)
