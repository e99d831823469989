"""Qhull's triangles, turned the same way around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial import QhullError

from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["hull_triangles"]


def hull_triangles(points: Floats) -> tuple[Integers, Integers]:
    """Triangles (t, 3) of the hull of points (n, 3), counter-clockwise seen from outside, and their
    neighbours (t, 3): `neighbors[t, k]` lies across the edge opposite to corner k.

    Raises scipy's QhullError where the points span no solid.
    """
    qhull = _qhull(points)
    triangles = qhull.simplices.astype(np.int64)
    neighbors = qhull.neighbors.astype(np.int64)
    outward = (doubled_area_vectors(points, triangles) * qhull.equations[:, :3]).sum(-1)
    flip = outward < 0.0
    if (_edge_parity(triangles, neighbors) != (flip[:, None] ^ flip[neighbors])).any():
        flip = _propagated_flip(triangles, neighbors, outward)
    triangles[flip] = triangles[flip][:, [0, 2, 1]]
    neighbors[flip] = neighbors[flip][:, [0, 2, 1]]
    return triangles, neighbors


def _qhull(points: Floats) -> QhullHull:
    """Hull triangles by Qhull. Where clusters of points make it give up on a facet that became
    wider than rounding explains, it is asked to go on: flat triangles are merged here anyway."""
    try:
        return QhullHull(points)
    except QhullError:
        return QhullHull(points, qhull_options="Qt Q12 Pp")


def _edge_parity(triangles: Integers, neighbors: Integers) -> NDArray[np.bool_]:
    """(t, 3) True where a triangle and its neighbour run along their common edge in the same
    direction, so that exactly one of the two must be turned."""
    parity = np.empty(triangles.shape, dtype=bool)
    for k in range(3):
        start, end = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        other = triangles[neighbors[:, k]]
        position = np.argmax(other == start[:, None], axis=1)
        parity[:, k] = other[np.arange(len(other)), (position + 1) % 3] == end
    return parity


def _propagated_flip(
    triangles: Integers, neighbors: Integers, outward: Floats
) -> NDArray[np.bool_]:
    """Turn every triangle consistently with the one whose orientation is clearest (slivers have
    normals that are only rounding noise)."""
    parity = _edge_parity(triangles, neighbors)
    start = int(np.argmax(np.abs(outward)))
    flip = np.zeros(len(triangles), dtype=bool)
    flip[start] = outward[start] < 0.0
    seen = np.zeros(len(triangles), dtype=bool)
    seen[start] = True
    stack = [start]
    while stack:
        t = stack.pop()
        for k in range(3):
            other = int(neighbors[t, k])
            if not seen[other]:
                seen[other] = True
                flip[other] = flip[t] ^ parity[t, k]
                stack.append(other)
    return flip
