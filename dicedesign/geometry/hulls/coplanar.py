"""Which triangles of a hull form one flat facet."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["facet_labels"]


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
