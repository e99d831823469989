"""The die from six sides and two corners."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["views_figure"]

_SIDES: Final[dict[str, tuple[int, int, int]]] = {
    "from +x": (1, 0, 0),
    "from +y": (0, 1, 0),
    "from +z": (0, 0, 1),
    "from (1, 1, 1)": (1, 1, 1),
    "from -x": (-1, 0, 0),
    "from -y": (0, -1, 0),
    "from -z": (0, 0, -1),
    "from (-1, -1, -1)": (-1, -1, -1),
}

_PIXELS: Final = 400


def views_figure(points: Floats, triangles: Integers) -> Paper:
    """A solid from six sides and two corners, all at one scale.

    The body's z is upward; seen from +z and -z it is y.

    points: (n, 3) in any length unit; triangles: (t, 3).
    """
    center = (points.min(axis=0) + points.max(axis=0)) / 2.0
    radius = 1.03 * float(np.linalg.norm(points - center, axis=1).max())
    surface = Surface(points, triangles, smooth=False)
    pictures = []
    for side in _SIDES.values():
        up = np.array([0.0, 1.0, 0.0] if side[:2] == (0, 0) else [0.0, 0.0, 1.0])
        camera = Camera(np.array(side, dtype=np.float64), up, center, radius)
        pictures.append(render(surface, camera, _PIXELS))
    return picture_grid(pictures, list(_SIDES), 4)


def _draw(die: FinishedDie) -> bytes:
    solid = die.plain.body if die.engraved is None else die.engraved
    assert solid.triangles is not None
    return views_figure(solid.points, solid.triangles).png()


FIGURES.register(
    Figure(
        name="views",
        line="the die from several sides",
        rank=50,
        title="The die from several sides",
        caption="All views have the same scale.",
        wanted=lambda die: die.reshaped is None,
        draw=_draw,
    )
)
