"""Small holes of a triangle mesh are filled with triangles between its own points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dicedesign.geometry.meshes.body import Body, distinct_triangles, outward_patches
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import (
    doubled_area_vectors,
    edge_keys,
    edge_neighbors,
    find_parts,
)
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

MAX_RIM = 200
"""Edges of the rim of a hole that is filled; the work grows with their cube."""

MAX_HOLES_SHARE = 0.5
"""Area of all fillings, over that of the surface, up to which they count as small."""

EDGE_WEIGHT = 1e-6
"""Weight of squared edges beside areas, which decides between triangulations of a flat hole."""

FLAT = 1e-9
"""Area over the squared longest edge below which a triangle is avoided."""


def fill_holes(body: Body) -> Body | None:
    """Body with triangles added that fill its holes, each with the least area.

    Points and triangles stay as they are. Returns None where that is not possible: there is no
    hole, more than two triangles share an edge, the surface is one-sided, or the holes are not
    small.

    Source: the dynamic program of Barequet and Sharir, Filling gaps in the boundary of a polyhedron
    (1995).
    """
    if body.triangles is None:
        return None
    triangles = outward_patches(body.points, distinct_triangles(body.triangles))
    edges, used = np.unique(edge_keys(triangles), return_counts=True)
    rims = _rims(body.points, triangles)
    if used.max() > 2 or not rims or sum(map(len, rims)) != np.count_nonzero(used == 1):
        return None
    if max(map(len, rims)) > MAX_RIM:
        return None
    size = int(triangles.max()) + 1
    fillings = []
    for rim in rims:
        pairs = np.minimum.outer(rim, rim) * size + np.maximum.outer(rim, rim)
        nearest = edges[np.searchsorted(edges, pairs).clip(max=len(edges) - 1)]
        is_edge = (nearest == pairs) | (rim[:, None] == rim)
        filling = _triangulate(body.points[rim], is_edge)
        if filling is None:
            return None
        fillings.append(rim[filling])
    added = np.concatenate(fillings)
    areas = [norms(doubled_area_vectors(body.points, each)).sum() for each in (added, triangles)]
    if areas[0] > MAX_HOLES_SHARE * areas[1]:
        return None
    note = f"filled {len(rims)} holes with {len(added)} triangles, no point moved"
    return replace(
        body, triangles=np.concatenate([body.triangles, added]), notes=(*body.notes, note)
    )


def _rims(points: Floats, triangles: Integers) -> list[Integers]:
    """Points around each hole, in the order in which triangles that fill it run.

    Where several holes meet in a point, each leads from one fan of triangles to the next counter-
    clockwise, so that the filled surface has one ring of triangles there.
    """
    neighbors = edge_neighbors(triangles)
    triangle, corner = np.nonzero(neighbors >= 0)
    across = neighbors[triangle, corner]
    rows, columns = [], []
    for k in (1, 2):
        here = (corner + k) % 3
        rows.append(3 * triangle + here)
        shared = triangles[across] == triangles[triangle, here][:, None]
        columns.append(3 * across + shared.argmax(axis=1))
    fans = find_parts(np.concatenate(rows), np.concatenate(columns), triangles.size)
    triangle, corner = np.nonzero(neighbors < 0)
    starts, ends = 3 * triangle + (corner + 1) % 3, 3 * triangle + (corner + 2) % 3
    tails, heads = triangles.ravel()[starts], triangles.ravel()[ends]
    angles = _fan_angles(points, triangles, fans)
    # Each fan has one edge that leaves its point and one that arrives there.
    leaving = np.lexsort((fans[starts], angles[fans[starts]], tails))
    arriving = np.lexsort((fans[ends], angles[fans[ends]], heads))
    if not np.array_equal(tails[leaving], heads[arriving]):
        return []
    first = np.searchsorted(tails[leaving], tails[leaving])
    last = np.searchsorted(tails[leaving], tails[leaving], side="right") - 1
    place = np.arange(len(tails))
    following = np.empty_like(place)
    following[arriving] = leaving[np.where(place < last, place + 1, first)]
    rims, pending = [], set(place.tolist())
    while pending:
        edge = pending.pop()
        rim = [edge]
        while (edge := int(following[edge])) != rim[0]:
            pending.remove(edge)
            rim.append(edge)
        rims.append(tails[rim[::-1]])
    return rims


def _fan_angles(points: Floats, triangles: Integers, fans: Integers) -> Floats:
    """(f,) direction of each fan about its point, seen from outside; fans: (3 t,) of corners."""
    corners, count = triangles.ravel(), int(fans.max()) + 1
    vectors = doubled_area_vectors(points, triangles)
    normals = sums_by_index(corners, np.repeat(vectors, 3, axis=0), len(points))[corners]
    arms = np.repeat(points[triangles].mean(axis=1), 3, axis=0) - points[corners]
    aside = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    x, y = (
        sums_by_index(fans, (arms * axis).sum(-1) / norms(axis).clip(np.finfo(float).tiny), count)
        for axis in (aside, np.cross(normals, aside))
    )
    return np.arctan2(y, x)


def _triangulate(rim: Floats, is_edge: Booleans) -> Integers | None:
    """Triangles (n - 2, 3) of least area between the points (n, 3) of a rim, in its order.

    is_edge: (n, n) pairs of points that no new edge may join, but for neighbors. None if there are
    no such triangles.
    """
    count = len(rim)
    costs = np.where(is_edge, np.inf, 0.0)
    place = np.arange(count)
    costs[place[:-1], place[1:]] = 0.0
    costs[0, -1] = 0.0
    middles = np.zeros((count, count), dtype=np.int64)
    for length in range(2, count):
        i = np.arange(count - length)[:, None]
        j, k = i + length, i + np.arange(1, length)
        a, b, c = rim[i], rim[k], rim[j]
        areas = norms(np.cross(b - a, c - a)) / 2.0
        squares = np.stack([((q - p) ** 2).sum(-1) for p, q in ((a, b), (b, c), (c + 0 * b, a))])
        flat = np.where(areas <= FLAT * squares.max(axis=0), squares.max(axis=0), 0.0)
        total = areas + EDGE_WEIGHT * squares.sum(axis=0) + flat + costs[i, k] + costs[k, j]
        best = total.argmin(axis=1)
        costs[i[:, 0], j[:, 0]] += total[i[:, 0], best]
        middles[i[:, 0], j[:, 0]] = i[:, 0] + 1 + best
    if not np.isfinite(costs[0, -1]):
        return None
    triangles, pending = [], [(0, count - 1)]
    while pending:
        first, last = pending.pop()
        if last > first + 1:
            middle = int(middles[first, last])
            triangles.append((first, middle, last))
            pending += [(first, middle), (middle, last)]
    return np.array(triangles)
