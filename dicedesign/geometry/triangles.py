"""Triangles of a mesh: areas, neighbors, what hangs together, and what lies inside."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.runtime.arrays import Floats, Integers


def doubled_area_vectors(points: Floats, triangles: Integers) -> Floats:
    """Normals of triangles, of length twice their areas.

    The cross product is taken of the two shorter edges: of two long and nearly parallel ones it
    would be rounding noise.

    points: (n, 3); triangles: (t, 3). Returns (t, 3), outward for triangles that run
    counter-clockwise seen from outside.
    """
    corners = points[triangles]
    opposite = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
    apex = np.argmax((opposite * opposite).sum(-1), axis=1)
    rows = np.arange(len(triangles))
    a, b, c = (corners[rows, (apex + k) % 3] for k in range(3))
    return np.linalg.cross(b - a, c - a)


def edge_keys(triangles: Integers) -> Integers:
    """(3 t,) a number for the edge from each corner of triangles (t, 3) to the next, the same for
    either direction and different for different edges."""
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    size = int(triangles.max()) + 1
    return np.minimum(tails, heads) * size + np.maximum(tails, heads)


def edge_neighbors(triangles: Integers) -> Integers:
    """Neighbours of triangles (t, 3): `[t, k]` lies across the edge opposite to corner k, or is -1
    where not exactly one triangle runs along that edge the other way around and none the same
    way."""
    tail, head = np.roll(triangles, -1, axis=1).ravel(), np.roll(triangles, -2, axis=1).ravel()
    size = np.int64(triangles.max()) + 1
    forward, backward = tail * size + head, head * size + tail
    order = np.argsort(forward, kind="stable")
    ranked = forward[order]
    first = np.searchsorted(ranked, backward)
    once = np.searchsorted(ranked, backward, side="right") == first + 1
    twin = order[np.minimum(first, len(order) - 1)]
    alone = np.bincount(np.searchsorted(ranked, forward), minlength=len(order))
    single = alone[np.searchsorted(ranked, forward)] == 1
    return np.where(once & single, twin // 3, -1).reshape(triangles.shape)


def connected_parts(tails: Integers, heads: Integers, count: int) -> Integers:
    """(count,) the part of each of so many things, numbered from 0 in the order of their first
    things, when pairs of them (m,) and (m,) are joined."""
    # Imported late: a query of a mesh does without SciPy.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(tails)), (tails, heads)), shape=(count, count))
    labels: Integers = connected_components(graph, directed=False)[1].astype(np.int64)
    return labels


def winding_number(point: Floats, corners: Floats) -> float:
    """Turns of closed oriented surfaces of triangles (t, 3, 3) around a point (3,): an integer,
    0 outside, to within rounding, but for a point on the surface."""
    a, b, c = (corners - point).transpose(1, 0, 2)
    return float(signed_solid_angle(a, b, c, np).sum()) / (4.0 * np.pi)
