"""The surface where a distance function is 0, evenly triangulated."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.concave.shapes.distance_functions import Distance
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index

__all__ = ["level_set"]

ROUNDS: Final = 15
"""Times that edges are flipped and points moved."""

FLIP_PASSES: Final = 3
"""Most passes over all edges each time."""

STEP: Final = 0.6
"""Part of the way to the middle of its neighbours that a point is moved."""

DIFFERENCE: Final = 1e-5
"""Step of the difference quotients, in cells."""

EXCESS: Final = 1e-9
"""Angle, in radians, by which those opposite to an edge must exceed 180 degrees to flip it."""

AROUND: Final = ((0, 0), (-1, 0), (-1, -1), (0, -1))
"""Offsets of the four cells about an edge of the grid."""


def level_set(distance: Distance, low: Floats, high: Floats, spacing: float) -> Surface:
    """Triangles with edges of about one length on the surface where a distance function is 0.

    A point is set in each cell of a grid that the surface passes through, and the points of the
    four cells about each crossed edge are joined (surface nets). Then points are moved toward the
    middle of their neighbours and back onto the level set, and edges flipped until the angles
    opposite to each sum to no more than 180 degrees, in turns.

    Parameters
    ----------
    distance: negative inside. No part of the body and no gap may be thinner than two cells.
    low, high: (3,) corners of a box that holds the surface with a cell to spare.
    spacing: side of the cells, above 0.

    Returns
    -------
    Surface, oriented outward; the same for the same input.

    Source: Gibson, Constrained elastic surface nets (MICCAI 1998), for the first step.
    """
    points, triangles = _surface_nets(distance, low, high, spacing)
    for _ in range(ROUNDS):
        triangles = _flipped(points, triangles)
        points = _onto(distance, _spread(points, triangles), spacing)
    return Surface(points, _flipped(points, triangles))


def _surface_nets(
    distance: Distance, low: Floats, high: Floats, spacing: float
) -> tuple[Floats, Integers]:
    """A point for each cell that the surface passes through and two triangles for each edge."""
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = distance(grid)
    crossings, quads = [], []
    for axis in range(3):
        step = np.eye(3, dtype=np.int64)[axis]
        nodes = np.stack(np.nonzero(np.diff(values < 0.0, axis=axis)), axis=-1)
        behind, ahead = values[tuple(nodes.T)], values[tuple((nodes + step).T)]
        part = behind / (behind - ahead)
        crossings.append(low + spacing * (nodes + part[:, None] * step))
        # Counter-clockwise seen from the far end of the edge, which is outside where it leaves.
        offsets = np.roll([(0, i, j) for i, j in AROUND], axis, axis=1)
        cells = np.ravel_multi_index((nodes[:, None] + offsets).transpose(2, 0, 1), values.shape)
        quads.append(np.where((behind < 0.0)[:, None], cells, cells[:, ::-1]))
    # Numbered without gaps.
    corners = np.unique(np.concatenate(quads), return_inverse=True)[1].reshape(-1, 4)
    count = np.bincount(corners.ravel())
    crossed = np.concatenate(crossings).repeat(4, axis=0)
    points = sums_by_index(corners.ravel(), crossed, len(count)) / count[:, None]
    return points, np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


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


def _onto(distance: Distance, points: Floats, spacing: float) -> Floats:
    """Points after a Newton step toward the level set, no longer than half a cell."""
    step = DIFFERENCE * spacing
    values = distance(points)
    slopes = (distance(points[:, None] + step * np.eye(3)) - values[:, None]) / step
    squares = (slopes * slopes).sum(axis=-1).clip(0.25)
    steps = (values / squares).clip(-0.5 * spacing, 0.5 * spacing)
    return points - steps[:, None] * slopes


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
