"""How the center of mass of a uniform solid follows the points of its surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.concave.surface import Surface

__all__ = ["centroid_derivatives"]

Floats = NDArray[np.float64]


def centroid_derivatives(surface: Surface) -> Floats:
    """(3, n, 3) derivative of each coordinate of the centroid by each coordinate of the points
    (eq. 34)."""
    center = surface.centroid
    corners = surface.points[surface.triangles] - center
    lifts = np.linalg.cross(np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)) / 6.0
    volumes = (corners[:, 0] * lifts[:, 0]).sum(-1)
    means = corners.sum(axis=1) / 4.0
    by_corner = means[:, None, :, None] * lifts[:, :, None, :]
    by_corner += (volumes / 4.0)[:, None, None, None] * np.eye(3)
    size = len(surface.points)
    derivatives = np.empty((3, size, 3))
    for row in range(3):
        for column in range(3):
            derivatives[row, :, column] = np.bincount(
                surface.triangles.ravel(), by_corner[:, :, row, column].ravel(), size
            )
    return derivatives / volumes.sum()
