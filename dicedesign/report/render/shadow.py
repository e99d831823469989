"""The shadow of a body on a table, by which one sees how high above it the body is."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.report.render.raster import Camera, rasterize
from dicedesign.report.render.shading import blurred
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["shadowed_table"]

_BLUR: Final = 0.024

_SHADOW: Final = 0.18

_CONTACT: Final = 0.45

_FADING: Final = 6.0


def shadowed_table(
    points: Floats,
    triangles: Integers,
    heights: Floats,
    up: Floats,
    camera: Camera,
    size: int,
    reach: float,
) -> Floats:
    """Brightness (size, size) from 0 to 1 of a white table under a body, lit from above: the lower
    the body is above a place, the darker.

    Parameters
    ----------
    points: (n, 3) of the body, in any length unit; triangles: (t, 3).
    heights: (n,) of the points above the table, at least 0.
    up: (3,) unit vector.
    camera: where to look from, from above the table; size: pixels a side.
    reach: length over which shadows fade.
    """
    positions = camera.pixel_positions(points - heights[:, None] * up, size)
    positions[:, 2] = -heights / reach
    seen, depth = rasterize(positions, triangles, size)
    dark = np.where(seen >= 0, _SHADOW + _CONTACT * np.exp(_FADING * depth), 0.0)
    blur = _BLUR * reach * size / (2.0 * camera.half_width)
    return np.asarray(1.0 - blurred(dark, blur))
