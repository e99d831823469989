"""Pairs of triangles that a plane clearly parts, so that nothing about them is left to decide."""

from __future__ import annotations

import numpy as np

from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import ROUNDING, UNDERFLOW

__all__ = ["close_pairs"]


def close_pairs(first: Floats, second: Floats, common: int) -> Integers:
    """The pairs of triangles of which rounding lets no plane say that they are apart.

    Triangles are apart when all corners of one lie strictly above all of the other, or, where they
    share their first corner, above that corner and the others of the other below it.

    first, second: (m, 3, 3) corners of triangles with area; common: 1 if they share their first
    corners, 0 if they share none. Returns indices of pairs, rising.
    """
    close = np.arange(len(first))
    for part in range(8 if common == 0 else 1):
        one, other = first[close], second[close]
        axis = _between_nearest_edges(one, other) if common else _upright(one, other, part)
        close = close[~_apart(axis, one, other, common)]
    return close


def _upright(first: Floats, second: Floats, part: int) -> Floats:
    """(m, 3) the normal of the first or the second triangles, for part 0 or 1, or the direction in
    the plane of one of them that is normal to one of its edges, for parts 2 to 7."""
    corners = (first, second)[part % 2]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if part < 2:
        return normal
    edge = part // 2 - 1
    return np.cross(normal, corners[:, edge] - corners[:, edge - 1])


def _between_nearest_edges(first: Floats, second: Floats) -> Floats:
    """(m, 3) the difference of the directions of those two edges at the common corner, one of each
    triangle, that are nearest to each other."""
    one, other = (_directions(corners) for corners in (first, second))
    nearest = (one[:, :, None] * other[:, None]).sum(axis=3).reshape(-1, 4).argmax(axis=1)
    rows = np.arange(len(one))
    return other[rows, nearest % 2] - one[rows, nearest // 2]


def _directions(corners: Floats) -> Floats:
    """(m, 2, 3) unit vectors from the first corner to the others."""
    edges = corners[:, 1:] - corners[:, :1]
    return edges / np.linalg.norm(edges, axis=2, keepdims=True)


def _apart(axis: Floats, first: Floats, second: Floats, common: int) -> Booleans:
    """True (m,) where the heights of corners along an axis part them beyond rounding."""
    origin = first[:, :1]
    one, other = ((corners - origin)[:, common:] * axis[:, None] for corners in (first, second))
    size = np.maximum(np.abs(one).sum(axis=2).max(axis=1), np.abs(other).sum(axis=2).max(axis=1))
    error = ROUNDING * size + UNDERFLOW
    one, other = one.sum(axis=2), other.sum(axis=2)
    if common:
        return (one.max(axis=1) < -error) & (other.min(axis=1) > error)
    return (other.min(axis=1) - one.max(axis=1) > 2 * error) | (
        one.min(axis=1) - other.max(axis=1) > 2 * error
    )
