"""Qhull's triangles of points, and the polygonal facets that they form, as loops of half-edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial import QhullError

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Floats, Integers, ragged_ranges


def hull_triangles(points: Floats) -> tuple[Integers, Integers]:
    """Triangles (t, 3) of the hull of points (n, 3), counter-clockwise seen from outside, and their
    neighbours (t, 3): `neighbors[t, k]` lies across the edge opposite to corner k.

    Raises scipy's QhullError where the points span no solid.
    """
    qhull = _qhull(points)
    triangles = qhull.simplices.astype(np.int64)
    neighbors = qhull.neighbors.astype(np.int64)
    outward = (doubled_area_vectors(points, triangles) * qhull.equations[:, :3]).sum(-1)
    flip = outward < 0.0
    if (_edge_parity(triangles, neighbors) != (flip[:, None] ^ flip[neighbors])).any():
        flip = _propagated_flip(triangles, neighbors, outward)
    triangles[flip] = triangles[flip][:, [0, 2, 1]]
    neighbors[flip] = neighbors[flip][:, [0, 2, 1]]
    return triangles, neighbors


def _qhull(points: Floats) -> QhullHull:
    """Hull triangles by Qhull. Where clusters of points make it give up on a facet that became
    wider than rounding explains, it is asked to go on: flat triangles are merged here anyway."""
    try:
        return QhullHull(points)
    except QhullError:
        return QhullHull(points, qhull_options="Qt Q12 Pp")


def _edge_parity(triangles: Integers, neighbors: Integers) -> NDArray[np.bool_]:
    """(t, 3) True where a triangle and its neighbour run along their common edge in the same
    direction, so that exactly one of the two must be turned."""
    parity = np.empty(triangles.shape, dtype=bool)
    for k in range(3):
        start, end = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        other = triangles[neighbors[:, k]]
        position = np.argmax(other == start[:, None], axis=1)
        parity[:, k] = other[np.arange(len(other)), (position + 1) % 3] == end
    return parity


def _propagated_flip(
    triangles: Integers, neighbors: Integers, outward: Floats
) -> NDArray[np.bool_]:
    """Turn every triangle consistently with the one whose orientation is clearest (slivers have
    normals that are only rounding noise)."""
    parity = _edge_parity(triangles, neighbors)
    start = int(np.argmax(np.abs(outward)))
    flip = np.zeros(len(triangles), dtype=bool)
    flip[start] = outward[start] < 0.0
    seen = np.zeros(len(triangles), dtype=bool)
    seen[start] = True
    stack = [start]
    while stack:
        t = stack.pop()
        for k in range(3):
            other = int(neighbors[t, k])
            if not seen[other]:
                seen[other] = True
                flip[other] = flip[t] ^ parity[t, k]
                stack.append(other)
    return flip


def facet_labels(
    points: Floats, triangles: Integers, neighbors: Integers, tolerance: float
) -> Integers:
    """Facet number of each triangle: all corners of a facet lie within `tolerance` of the plane of
    its largest triangle.

    points: (n, 3); triangles: (t, 3) counter-clockwise seen from outside; neighbors: (t, 3) across
    the edge opposite to each corner; tolerance: a length. Returns (t,) integers from 0.
    """
    doubled = doubled_area_vectors(points, triangles)
    area = norms(doubled)
    normals = doubled / np.maximum(area, np.finfo(np.float64).tiny)[:, None]
    left = np.repeat(np.arange(len(triangles)), 3)
    right = neighbors.ravel()
    # Measured from the larger triangle of each pair: a sliver has no normal worth the name.
    base = np.where(area[left] >= area[right], left, right)
    other = left + right - base
    gap = _distance(points, triangles, normals, base, other)
    joined = gap <= tolerance
    if not joined.any():
        return np.arange(len(triangles))
    while True:
        graph = coo_array(
            (np.ones(int(joined.sum())), (left[joined], right[joined])), shape=(len(triangles),) * 2
        )
        labels = connected_components(graph, directed=False)[1].astype(np.int64)
        # A chain of small bends is no facet: compare with the plane of each group's largest
        # triangle.
        largest = _largest(labels, area)
        drift = _distance(points, triangles, normals, largest[labels], np.arange(len(triangles)))
        for group in np.unique(labels[drift > tolerance]):
            labels = _grown(
                points, triangles, neighbors, normals, area, labels, int(group), tolerance
            )
        labels = np.unique(labels, return_inverse=True)[1].astype(np.int64)
        # A sliver among slivers finds no plane in its neighbours, but it does in their groups.
        largest = _largest(labels, area)
        base = largest[labels[right]]
        smaller = (labels[left] != labels[right]) & (area[largest[labels[left]]] < area[base])
        missed = smaller & (_distance(points, triangles, normals, base, left) <= tolerance)
        missed &= ~joined
        if not missed.any():
            return labels
        joined |= missed


def _largest(labels: Integers, area: Floats) -> Integers:
    """The largest triangle of each label."""
    order = np.argsort(area, kind="stable")
    largest = np.empty(int(labels.max()) + 1, dtype=np.int64)
    largest[labels[order]] = order
    return largest


def _distance(
    points: Floats, triangles: Integers, normals: Floats, base: Integers, other: Integers
) -> Floats:
    """Largest distance of the corners of `other` from the plane of `base`."""
    offset = points[triangles[other]] - points[triangles[base, 0]][:, None, :]
    return np.abs((offset * normals[base][:, None, :]).sum(-1)).max(axis=1)


def _grown(
    points: Floats,
    triangles: Integers,
    neighbors: Integers,
    normals: Floats,
    area: Floats,
    labels: Integers,
    group: int,
    tolerance: float,
) -> Integers:
    """Split one group into regions grown from its largest triangles outward."""
    members = np.flatnonzero(labels == group)
    labels = labels.copy()
    labels[members] = -1
    number = int(labels.max()) + 1
    for seed in members[np.argsort(-area[members], kind="stable")]:
        if labels[seed] != -1:
            continue
        labels[seed] = number
        front = [int(seed)]
        while front:
            for other in neighbors[front.pop()]:
                if labels[other] == -1:
                    index = np.array([other])
                    if _distance(points, triangles, normals, np.array([seed]), index) <= tolerance:
                        labels[other] = number
                        front.append(int(other))
        number += 1
    return labels


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
