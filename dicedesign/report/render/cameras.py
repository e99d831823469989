"""Where to look at a surface from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.report.render.raster import Camera
from dicedesign.runtime.arrays import Floats

__all__ = ["framed", "three_cameras", "upward_of"]

_UPRIGHT: Final = (".stl", ".3mf", ".xyz")
"""Files of programs for printing and construction, whose z axis is upward; in those of programs
for pictures it is y."""

_TURNS: Final = (35.0, 155.0, 275.0)

_RISE: Final = 15.0

_MARGIN: Final = 1.08


def three_cameras(points: Floats, up: Floats) -> list[Camera]:
    """Cameras around points, 120 degrees apart and a little above them, all at one scale.

    points: (n, 3) in any length unit, all of which are seen; up: (3,) upward in the pictures, of
    any length above 0. The first camera looks at the body's front, which is +z where y is upward
    and -y where z is, from the right.
    """
    upward = up / np.linalg.norm(up)
    right = np.eye(3)[int(abs(upward[0]) > np.sqrt(0.5))]
    right = right - (right @ upward) * upward
    right = right / np.linalg.norm(right)
    front = np.cross(right, upward)
    rise = np.radians(_RISE)
    cameras = []
    for turn in np.radians(_TURNS):
        level = np.cos(turn) * front + np.sin(turn) * right
        direction = np.cos(rise) * level + np.sin(rise) * upward
        cameras.append(Camera(direction, upward, np.zeros(3), 1.0))
    return framed(cameras, [points] * len(cameras))


def upward_of(path: Path) -> Floats:
    """(3,) direction that is upward in a mesh file, by its ending."""
    return np.eye(3)[2 if path.suffix.lower() in _UPRIGHT else 1]


def framed(cameras: Sequence[Camera], points: Sequence[Floats]) -> list[Camera]:
    """Cameras that look the same way, moved and at one scale such that each has its points (n, 3)
    in the middle of its picture and none of them outside."""
    moved, half_widths = [], []
    for camera, seen in zip(cameras, points, strict=True):
        places = seen @ camera.frame().T
        low, high = places.min(axis=0), places.max(axis=0)
        moved.append(replace(camera, center=(low + high) / 2.0 @ camera.frame()))
        half_widths.append(float((high - low)[:2].max()) / 2.0)
    return [replace(camera, half_width=_MARGIN * max(half_widths)) for camera in moved]
