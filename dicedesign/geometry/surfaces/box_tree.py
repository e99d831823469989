"""Pairs of boxes that overlap, by a tree of boxes."""

from __future__ import annotations

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["overlapping_boxes"]


def overlapping_boxes(lower: Floats, upper: Floats) -> Integers:
    """Pairs of boxes along the axes of coordinates that have a point in common.

    The boxes are halved at the median of their middles along the longest axis, again and again,
    into a complete binary tree; its nodes are met with each other level by level. Boxes of a
    triangle surface take O(n log n) time, whatever their sizes.

    lower, upper: (n, 3) the corners, lower <= upper. Returns (m, 2) pairs i < j, in order.
    """
    order, levels = _tree(lower, upper)
    first = second = np.zeros(1, dtype=np.int64)
    for low, high in levels[1:]:
        apart = first != second
        first, second = (
            np.concatenate(
                (2 * first, 2 * first + 1, 2 * first, 2 * first[apart] + 1),
            ),
            np.concatenate(
                (2 * second, 2 * second + 1, 2 * second + 1, 2 * second[apart]),
            ),
        )
        for axis in range(3):
            meet = (low[first, axis] <= high[second, axis]) & (
                low[second, axis] <= high[first, axis]
            )
            first, second = first[meet], second[meet]
    first, second = first[first != second], second[first != second]
    pairs = np.sort(np.stack((order[first], order[second]), axis=1), axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def _tree(lower: Floats, upper: Floats) -> tuple[Integers, list[tuple[Floats, Floats]]]:
    """The box at each leaf, and the corners of the nodes' boxes at each level from the root.

    Leaves beyond the number of boxes are empty: their box overlaps none.
    """
    count = len(lower)
    size = 1 << max(count - 1, 0).bit_length()
    low = np.full((size, 3), np.inf)
    high = np.full((size, 3), -np.inf)
    low[:count], high[:count] = lower, upper
    middles = np.full((size, 3), np.inf)
    middles[:count] = lower + 0.5 * (upper - lower)
    order = np.arange(size)
    nodes = 1
    while nodes < size:
        inside = order.reshape(nodes, -1)
        extent = high[inside].max(axis=1) - low[inside].min(axis=1)
        keys = middles[inside, extent.argmax(axis=1)[:, None]]
        order = np.take_along_axis(inside, keys.argsort(axis=1, kind="stable"), axis=1).ravel()
        nodes *= 2
    levels = [(low[order], high[order])]
    while len(levels[0][0]) > 1:
        below, above = levels[0]
        levels.insert(0, (np.minimum(below[::2], below[1::2]), np.maximum(above[::2], above[1::2])))
    return order, levels
