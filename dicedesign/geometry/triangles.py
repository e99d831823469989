"""Areas and directions of triangles that may be slivers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.runtime.arrays import Floats

__all__ = ["doubled_area_vectors", "edge_neighbors"]


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


def edge_neighbors(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Neighbours of triangles (t, 3): `[t, k]` lies across the edge opposite to corner k, or is -1
    where not exactly one triangle runs along that edge the other way around and none the same
    way."""
    tail, head = np.roll(triangles, -1, axis=1).ravel(), np.roll(triangles, -2, axis=1).ravel()
    size = np.int64(triangles.max()) + 1
    forward, backward = tail * size + head, head * size + tail
    order = np.argsort(forward, kind="stable")
    ranked = forward[order]
    first = np.searchsorted(ranked, backward)
    once = np.searchsorted(ranked, backward, side="right") == first + 1
    twin = order[np.minimum(first, len(order) - 1)]
    alone = np.bincount(np.searchsorted(ranked, forward), minlength=len(order))
    single = alone[np.searchsorted(ranked, forward)] == 1
    return np.where(once & single, twin // 3, -1).reshape(triangles.shape)
