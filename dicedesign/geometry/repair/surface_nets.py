"""The surface between the nodes of a grid that are inside and those that are not."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

__all__ = ["surface_nets", "without_double_cuts"]

AROUND: Final = ((0, 0), (-1, 0), (-1, -1), (0, -1))
"""Offsets of the four cells about an edge of the grid."""


def surface_nets(
    inside: Booleans, crossing: Callable[[Integers, Integers], Floats]
) -> tuple[Floats, Integers]:
    """A point for each cell that the surface passes through, at the mean of where it crosses the
    cell's edges, and two triangles for each edge that it crosses.

    Parameters
    ----------
    inside: (a, b, c) whether a node is; none on the border of the grid. Where a cell is cut twice
        (see `without_double_cuts`), sheets of the surface meet in its point.
    crossing: where the surface crosses edges, (m, 3), from their ends (m, 3) in steps of the grid.

    Returns
    -------
    Points (n, 3) in the coordinates of `crossing`, and triangles (t, 3) of a closed surface,
    oriented outward.

    Source: Gibson, Constrained elastic surface nets (MICCAI 1998), for the first step.
    """
    crossings, quads = [], []
    for axis in range(3):
        step = np.eye(3, dtype=np.int64)[axis]
        nodes = np.stack(np.nonzero(np.diff(inside, axis=axis)), axis=-1)
        crossings.append(crossing(nodes, nodes + step))
        # Counter-clockwise seen from the far end of the edge, which is outside where it leaves.
        offsets = np.roll([(0, i, j) for i, j in AROUND], axis, axis=1)
        cells = np.ravel_multi_index((nodes[:, None] + offsets).transpose(2, 0, 1), inside.shape)
        leaves = inside[tuple(nodes.T)]
        quads.append(np.where(leaves[:, None], cells, cells[:, ::-1]))
    # Numbered without gaps.
    corners = np.unique(np.concatenate(quads), return_inverse=True)[1].reshape(-1, 4)
    count = np.bincount(corners.ravel())
    crossed = np.concatenate(crossings).repeat(4, axis=0)
    points = sums_by_index(corners.ravel(), crossed, len(count)) / count[:, None]
    return points, np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def without_double_cuts(values: Floats) -> Booleans:
    """The nodes of a grid with values above 0, and as few others as it takes for no cell to be cut
    by two sheets of the surface between those and the rest.

    A cell is cut twice where two nodes at opposite corners of one of its faces, or of the cell
    itself, are on one side and all others of that face, or cell, on the other. Then the outer one
    of largest value is added, again and again: the surface of what is left is a manifold.

    Source: Latecki, 3D well-composed pictures (1997), for the condition.
    """
    inside = values > 0.0
    while True:
        added = np.zeros_like(inside)
        for offsets in _CUBES:
            corners = [_shifted(inside, offset) for offset in offsets]
            first = corners[0]
            cut = (corners[-1] == first) & ~np.logical_or.reduce(
                [corner == first for corner in corners[1:-1]]
            )
            cells = np.stack(np.nonzero(cut), axis=-1)
            nodes = cells[:, None] + np.array(offsets)
            places = tuple(nodes.transpose(2, 0, 1))
            outer = np.where(inside[places], -np.inf, values[places])
            chosen = nodes[np.arange(len(nodes)), outer.argmax(axis=1)]
            added[tuple(chosen.T)] = True
        if not added.any():
            return inside
        inside |= added


def _cubes() -> list[list[tuple[int, ...]]]:
    """Corners of the faces of a cell and of the cell, as often as they have pairs of opposite ones:
    such a pair first and last."""
    cubes = []
    for axes in ((0, 1), (1, 2), (0, 2), (0, 1, 2)):
        corners = list(product(*((0, 1) if axis in axes else (0,) for axis in range(3))))
        for near, far in zip(corners[: len(corners) // 2], corners[::-1], strict=False):
            others = [corner for corner in corners if corner not in (near, far)]
            cubes.append([near, *others, far])
    return cubes


_CUBES: Final = _cubes()


def _shifted(inside: Booleans, offset: tuple[int, ...]) -> Booleans:
    """The nodes at an offset, of 0 or 1 along each axis, from all but the last."""
    return inside[tuple(slice(d, d + n - 1) for d, n in zip(offset, inside.shape, strict=True))]
