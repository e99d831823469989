"""Closest points of a triangle surface: on a face, an edge or a corner, as weights of corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.distance import cdist

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["ClosestPoints", "closest_points", "closest_weights"]

PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a point and a triangle that are compared at a time, to bound the memory."""


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The point of a surface closest to each of k given points.

    Attributes
    ----------
    corners: (k, 3) the points of the surface whose weighted mean it is.
    weights: (k, 3) from 0 to 1, of sum 1; two of them are 0 at a corner, one on an edge.
    points: (k, 3) the mean itself.
    distances: (k,) from the given points.
    """

    corners: Integers
    weights: Floats
    points: Floats
    distances: Floats

    def matrix(self, size: int) -> csr_array:
        """(k, size) weights of all points of the surface."""
        rows = np.repeat(np.arange(len(self.corners)), 3)
        entries = (self.weights.ravel(), (rows, self.corners.ravel()))
        return csr_array(entries, shape=(len(self.corners), size))


def closest_points(surface: Surface, points: Floats) -> ClosestPoints:
    """The closest point of a surface to each of points (k, 3); of equally close ones any.

    Only triangles whose circle about their mean corner comes as near as some corner of the surface
    are looked at closely.
    """
    corners = surface.points[surface.triangles]
    centers = corners.mean(axis=1)
    radii = norms(corners - centers[:, None]).max(axis=1)
    rows = max(1, PAIRS_AT_ONCE // len(centers))
    query, triangle = [], []
    for first in range(0, len(points), rows):
        distances = cdist(points[first : first + rows], centers)
        # Each triangle has a point at most this far, and none nearer than the other.
        bound = (distances + radii).min(axis=1)
        near = np.nonzero(distances - radii <= bound[:, None])
        query.append(near[0] + first)
        triangle.append(near[1])
    queries, candidates = np.concatenate(query), np.concatenate(triangle)
    weights = closest_weights(points[queries], corners[candidates])
    found = (weights[:, :, None] * corners[candidates]).sum(axis=1)
    distances = norms(found - points[queries])
    order = np.lexsort([distances, queries])
    best = order[np.searchsorted(queries[order], np.arange(len(points)))]
    return ClosestPoints(
        surface.triangles[candidates[best]], weights[best], found[best], distances[best]
    )


def closest_weights(points: Floats, corners: Floats) -> Floats:
    """(m, 3) weights of the corners of triangles (m, 3, 3), flat ones included, that make the
    closest point of each triangle to one point of (m, 3)."""
    best = _on_faces(points, corners)
    inside = (best >= 0.0).all(axis=1)
    least = np.full(len(points), np.inf)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, end] - corners[:, start]
        length = (edge * edge).sum(-1)
        along = ((points - corners[:, start]) * edge).sum(-1)
        part = np.clip(along / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        distance = norms(corners[:, start] + part[:, None] * edge - points)
        nearer = ~inside & (distance < least)
        weights = np.zeros((len(points), 3))
        weights[:, start], weights[:, end] = 1.0 - part, part
        best[nearer] = weights[nearer]
        least[nearer] = distance[nearer]
    return best


def _on_faces(points: Floats, corners: Floats) -> Floats:
    """(m, 3) weights of the foot of the perpendicular onto the plane; -1 for a flat triangle."""
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    normal = np.linalg.cross(opposite[:, 1], opposite[:, 2])
    squared = (normal * normal).sum(-1)
    arms = points[:, None] - np.roll(corners, -1, axis=1)
    parts = (np.linalg.cross(opposite, arms) * normal[:, None]).sum(-1)
    flat = squared <= 0.0
    weights = parts / np.where(flat, 1.0, squared)[:, None]
    weights[flat] = -1.0
    weights /= np.where(flat, 1.0, weights.sum(axis=1))[:, None]
    return weights
