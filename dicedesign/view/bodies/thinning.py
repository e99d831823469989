"""A mesh with fewer triangles, to be looked at: nothing is computed from it."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["MOST_SHOWN", "thinned"]

MOST_SHOWN: Final = 150_000
"""Triangles that a browser draws at once; a mesh of more is thinned."""

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


def _from_least(corners: Integers) -> Integers:
    """Triangles (t, 3) turned so that each begins with its least corner."""
    first = corners.argmin(axis=1)
    return np.take_along_axis(corners, (first[:, None] + np.arange(3)) % 3, axis=1)
