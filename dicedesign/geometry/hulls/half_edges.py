"""From labelled triangles to facets as loops of half-edges."""

from __future__ import annotations

import numpy as np

from dicedesign.runtime.arrays import Integers, ragged_ranges

__all__ = ["HalfEdges", "facet_loops"]

HalfEdges = tuple[Integers, Integers, Integers, Integers]
"""`source`, `facet_start`, `tail` and `twin` of a `ConvexHull`."""


def facet_loops(
    points: int, triangles: Integers, neighbors: Integers, labels: Integers
) -> HalfEdges | None:
    """Polygonal half-edge structure of labelled triangles, or None where it is no polyhedron.

    points: how many there are; triangles: (t, 3) of them, a closed surface, counter-clockwise seen
    from outside; neighbors: (t, 3) across the edge opposite to each corner; labels: (t,) facet of
    each triangle, from 0. Corners at which only two facets meet are left out.
    """
    border = labels[:, None] != labels[neighbors]
    triangle, corner = np.nonzero(border)
    tail = triangles[triangle, (corner + 1) % 3]
    head = triangles[triangle, (corner + 2) % 3]
    facet = labels[triangle]
    facets = int(labels.max()) + 1
    count = np.bincount(facet, minlength=facets)
    if len(tail) < 12 or (count < 3).any():
        return None
    # The follower of a half-edge starts, in the same facet, where it ends.
    size = np.int64(points)
    key = facet * size + tail
    order = np.argsort(key)
    found = np.minimum(np.searchsorted(key[order], facet * size + head), len(order) - 1)
    follower = order[found]
    if (key[follower] != facet * size + head).any():
        return None
    walk = _walk_facets(facet, follower, count)
    if walk is None:
        return None
    tail, facet = tail[walk], facet[walk]
    keep = np.bincount(tail, minlength=points)[tail] >= 3
    tail, facet = tail[keep], facet[keep]
    count = np.bincount(facet, minlength=facets)
    if (count < 3).any():
        return None
    facet_start = np.concatenate([[0], np.cumsum(count)])
    source, tail = np.unique(tail, return_inverse=True)
    facet_start, tail = _sorted_facets(facet_start, tail)
    following = np.arange(1, len(tail) + 1)
    following[facet_start[1:] - 1] = facet_start[:-1]
    size, head = np.int64(len(source)), tail[following]
    forward, backward = tail * size + head, head * size + tail
    order = np.argsort(forward)
    found = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    twin = order[found]
    if (forward[twin] != backward).any() or len(source) - len(tail) // 2 + facets != 2:
        return None
    return source, facet_start, tail, twin


def _sorted_facets(facet_start: Integers, tail: Integers) -> tuple[Integers, Integers]:
    """The same facets in the order that `ConvexHull` describes."""
    start, count = facet_start[:-1], np.diff(facet_start)
    owner = np.repeat(np.arange(len(count)), count)
    first = np.lexsort((tail, owner))[start] - start
    second = tail[start + (first + 1) % count]
    order = np.lexsort((second, tail[start + first]))
    facet, step = ragged_ranges(np.zeros(len(order), dtype=np.int64), count[order])
    old = order[facet]
    walk = start[old] + (first[old] + step) % count[old]
    return np.concatenate([[0], np.cumsum(count[order])]), tail[walk]


def _walk_facets(facet: Integers, follower: Integers, count: Integers) -> Integers | None:
    """Half-edges in walking order, facet by facet, or None if a facet's border is not one loop."""
    start = np.concatenate([[0], np.cumsum(count)])
    current = np.empty(len(count), dtype=np.int64)
    current[facet[::-1]] = np.arange(len(facet))[::-1]
    first = current.copy()
    walk = np.empty(len(facet), dtype=np.int64)
    active = np.arange(len(count))
    for step in range(int(count.max())):
        if step > 0 and (current[active] == first[active]).any():
            return None
        walk[start[active] + step] = current[active]
        current[active] = follower[current[active]]
        active = active[count[active] > step + 1]
    return walk if (current == first).all() else None
