"""Triangles of about one size and shape on a surface that stays where it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers, sums_by_index

__all__ = ["evened"]

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
