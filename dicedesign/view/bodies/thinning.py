"""A mesh with fewer triangles, to be looked at: nothing is computed from it."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["MOST_POINTS", "MOST_SHOWN", "farthest_points", "thinned"]

MOST_SHOWN: Final = 150_000
"""Triangles that a browser draws at once; a mesh of more is thinned."""

MOST_POINTS: Final = 1_000_000
"""Of a mesh whose whole hull is looked at; of one with more, that of its farthest points."""

WAYS: Final = 64
"""Cells along each side of the cube in which directions are told apart: 24,576 in all."""

FINEST: Final = 256

COARSEST: Final = 16


def thinned(points: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """A mesh of at most `MOST_SHOWN` triangles: points (n, 3) in one cell of a grid become one.

    The grid is as fine as allows; a mesh that is small enough is returned as it is. Source:
    Rossignac and Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993.
    """
    if len(triangles) <= MOST_SHOWN:
        return points, triangles
    lowest = points.min(axis=0)
    extent = float(np.ptp(points, axis=0).max())
    cells = FINEST
    while True:
        place = np.minimum((points - lowest) * (cells / extent), cells - 1).astype(np.int64)
        keys = (place[:, 0] * cells + place[:, 1]) * cells + place[:, 2]
        known, group, sizes = np.unique(keys, return_inverse=True, return_counts=True)
        corners = group[triangles]
        whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
        kept = np.unique(_from_least(corners[whole]), axis=0)
        if len(kept) <= MOST_SHOWN or cells <= COARSEST:
            break
        # Triangles are as many as cells that the surface passes through.
        cells = max(COARSEST, int(cells * 0.95 * np.sqrt(MOST_SHOWN / len(kept))))
    sums = [np.bincount(group, points[:, axis], len(known)) for axis in range(3)]
    return np.stack(sums, axis=1) / sizes[:, None], kept


def farthest_points(points: Floats) -> Floats:
    """(m, 3) of points (n, 3), the one that is farthest from their middle in each of `WAYS`
    directions: the hull of these is a little within that of all."""
    arms = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    along = np.abs(arms).argmax(axis=1)
    rows = np.arange(len(arms))
    longest = arms[rows, along]
    kept = longest != 0.0
    cell = 2 * along + (longest > 0.0)
    for turn in (1, 2):
        part = arms[rows, (along + turn) % 3] / np.where(kept, np.abs(longest), 1.0)
        cell = cell * WAYS + np.minimum((0.5 + 0.5 * part) * WAYS, WAYS - 1).astype(np.int64)
    distance = (arms * arms).sum(axis=1)
    order = np.lexsort((distance, cell))
    last = np.append(cell[order[1:]] != cell[order[:-1]], True)
    return points[np.sort(order[last])]


def _from_least(corners: Integers) -> Integers:
    """Triangles (t, 3) turned so that each begins with its least corner."""
    first = corners.argmin(axis=1)
    return np.take_along_axis(corners, (first[:, None] + np.arange(3)) % 3, axis=1)
