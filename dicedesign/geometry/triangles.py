"""Areas and directions of triangles that may be slivers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["doubled_area_vectors"]

Floats = NDArray[np.float64]


def doubled_area_vectors(points: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Normals of triangles, of length twice their areas.

    The cross product is taken of the two shorter edges: of two long and nearly parallel ones it
    would be rounding noise.

    points: (n, 3); triangles: (t, 3). Returns (t, 3), outward for triangles that run
    counter-clockwise seen from outside.
    """
    corners = points[triangles]
    opposite = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
    apex = np.argmax((opposite * opposite).sum(-1), axis=1)
    rows = np.arange(len(triangles))
    a, b, c = (corners[rows, (apex + k) % 3] for k in range(3))
    return np.linalg.cross(b - a, c - a)
