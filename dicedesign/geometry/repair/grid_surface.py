"""Surfaces from a grid: between its nodes inside and those outside, with even triangles that do not
meet each other."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Final

import numpy as np

from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

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


FLIP_PASSES: Final = 3
"""Most passes over all edges each time."""

STEP: Final = 0.6
"""Part of the way to the middle of its neighbours that a point is moved."""

EXCESS: Final = 1e-9
"""Angle, in radians, by which those opposite to an edge must exceed 180 degrees to flip it."""


def evened(
    points: Floats, triangles: Integers, onto: Callable[[Floats, Integers], Floats], rounds: int
) -> tuple[Floats, Integers]:
    """The points and triangles of a closed surface, moved along it and joined otherwise so that the
    triangles are more even.

    In turns points are moved toward the middle of their neighbours and back onto the surface, and
    edges flipped until the angles opposite to each sum to no more than 180 degrees.

    Parameters
    ----------
    points, triangles: (n, 3) and (t, 3), of a closed oriented surface.
    onto: moves points (n, 3), joined by triangles (t, 3), onto the surface.
    rounds: how often that is done.
    """
    for _ in range(rounds):
        triangles = _flipped(points, triangles)
        points = onto(_spread(points, triangles), triangles)
    return points, _flipped(points, triangles)


def _spread(points: Floats, triangles: Integers) -> Floats:
    """Points moved part of the way to the middle of the triangles around them, by area."""
    corners = points[triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1
    )
    weights = sums_by_index(triangles.ravel(), areas.repeat(3), len(points))
    moments = (areas[:, None] * corners.mean(axis=1)).repeat(3, axis=0)
    middles = sums_by_index(triangles.ravel(), moments, len(points)) / weights[:, None]
    return points + STEP * (middles - points)


def _flipped(points: Floats, triangles: Integers) -> Integers:
    """The triangles with edges flipped where the angles opposite to one sum to more than 180
    degrees, as long as that is so and the new edge does not exist yet."""
    triangles = triangles.copy()
    size = len(points)
    for _ in range(FLIP_PASSES):
        tail, head = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
        forward = tail * size + head
        order = np.argsort(forward)
        twin = order[np.searchsorted(forward[order], head * size + tail)]
        apex = np.roll(triangles, -2, axis=1).ravel()
        a, b = points[tail] - points[apex], points[head] - points[apex]
        angles = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))
        excess = angles + angles[twin] - np.pi
        candidates = np.flatnonzero((excess > EXCESS) & (tail < head))
        if not len(candidates):
            break
        edges = set(forward.tolist())
        touched: set[int] = set()
        for half in candidates[np.argsort(-excess[candidates], kind="stable")].tolist():
            other = int(twin[half])
            one, two = half // 3, other // 3
            p, q = int(apex[half]), int(apex[other])
            if one in touched or two in touched or p * size + q in edges:
                continue
            touched |= {one, two}
            edges |= {p * size + q, q * size + p}
            triangles[one] = p, tail[half], q
            triangles[two] = q, head[half], p
    return triangles


MOST: Final = 300
"""Pairs of triangles that meet, from which on that is hopeless."""

ROUNDS: Final = 8
"""Times that the places are looked for."""

SMOOTHINGS: Final = 3
"""Times that their points are moved each time."""

RINGS: Final = 1
"""Of points around those of triangles that meet, moved with them."""


def untangled(surface: Surface) -> Surface | None:
    """The surface with points around triangles that meet moved to the mean of their neighbors,
    again and again and wider, until no two meet; None where some still do in the end."""
    points, triangles = surface.points.copy(), surface.triangles
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    near = np.zeros(len(points), dtype=bool)
    for _ in range(ROUNDS):
        pairs = intersecting_triangles(points, triangles)
        if len(pairs) == 0:
            return surface.moved(points)
        if len(pairs) > MOST:
            break
        near[triangles[pairs]] = True
        for _ in range(RINGS):
            near[heads[near[tails]]] = True
        # Each edge of a closed surface is there once each way.
        edges = np.flatnonzero(near[tails])
        count = np.bincount(tails[edges], minlength=len(points))[near]
        for _ in range(SMOOTHINGS):
            sums = sums_by_index(tails[edges], points[heads[edges]], len(points))[near]
            points[near] = sums / count[:, None]
    return None
