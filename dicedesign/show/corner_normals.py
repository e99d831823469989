"""Normals that make a mesh of flat triangles look like the surface it stands for."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.ragged import ragged_ranges

__all__ = ["corner_normals"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_SMOOTH_DEGREES: Final = 35.0


def corner_normals(points: Floats, triangles: Integers) -> Floats:
    """(t, 3, 3) unit normals at the corners of triangles, to be interpolated within each.

    The normal at a corner is the mean, by area, of those of the triangles at its vertex that turn
    at most 35 degrees from the corner's own triangle: smooth parts are shaded smoothly, and sharp
    edges stay sharp. Those of triangles without area are 0.

    points: (n, 3) in any length unit; triangles: (t, 3), oriented alike.
    """
    corners = points[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(areas, axis=1, keepdims=True)
    flat = np.divide(areas, sizes, out=np.zeros_like(areas), where=sizes > 0.0)
    vertex = triangles.ravel()
    by_vertex = np.argsort(vertex, kind="stable")
    counts = np.bincount(vertex, minlength=len(points))
    starts = np.cumsum(counts) - counts
    # Each corner with each corner at the same vertex.
    corner, place = ragged_ranges(starts[vertex], counts[vertex])
    triangle, other = corner // 3, by_vertex[place] // 3
    smooth = (flat[triangle] * flat[other]).sum(-1) >= np.cos(np.radians(_SMOOTH_DEGREES))
    corner, other = corner[smooth], other[smooth]
    sums = np.stack(
        [np.bincount(corner, areas[other, k], minlength=len(vertex)) for k in range(3)], axis=1
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    normals = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0.0)
    return normals.reshape(-1, 3, 3)
