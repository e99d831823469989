"""A die from four sides that together show all of it."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.report.charts.paper import Picture
from dicedesign.report.render.cameras import framed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.runtime.arrays import Floats

__all__ = ["CORNERS", "four_views"]

CORNERS: Final = ((1, -1, 1), (1, 1, -1), (-1, 1, 1), (-1, -1, -1))
"""Of a tetrahedron: no part of a convex die is seen at a slant of more than 71 degrees from all of
them."""

_AROUND: Final = {"front": 30.0, "right": 120.0, "back": 210.0, "left": 300.0}
"""Turns about the upward direction in degrees, from the front."""

_RISE: Final = 15.0


def four_views(surface: Surface, upward: Floats, size: int) -> list[tuple[str, Picture]]:
    """Pictures of a size in pixels, and from where they are.

    A smooth surface is seen from around it, another from the corners of a tetrahedron.

    upward: (3,) direction that is up, an axis.
    """
    if surface.smooth:
        right = np.roll(upward, 1)
        front = np.cross(right, upward)
        rise = np.radians(_RISE)
        sides = {}
        for name, turn in _AROUND.items():
            level = np.cos(np.radians(turn)) * front + np.sin(np.radians(turn)) * right
            sides[name] = np.cos(rise) * level + np.sin(rise) * upward
    else:
        sides = {
            "from ({}, {}, {})".format(*corner): np.array(corner, dtype=np.float64)
            for corner in CORNERS
        }
    cameras = [Camera(side, upward, np.zeros(3), 1.0) for side in sides.values()]
    cameras = framed(cameras, [surface.points] * len(cameras))
    return [
        (name, render(surface, camera, size)) for name, camera in zip(sides, cameras, strict=True)
    ]
