"""Distances of points from a triangle surface."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial.distance import cdist

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

__all__ = ["distances_from_surface", "distances_from_triangles"]

PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a point and a triangle that are compared at a time, to bound the memory."""


def distances_from_surface(surface: Surface, points: Floats) -> Floats:
    """(k,) distances of points (k, 3) from a surface, in its unit of length.

    Only triangles whose circle about their mean corner comes as near as some corner of the surface
    are looked at closely.
    """
    corners = surface.points[surface.triangles]
    centers = corners.mean(axis=1)
    radii = norms(corners - centers[:, None]).max(axis=1)
    rows = max(1, PAIRS_AT_ONCE // len(centers))
    least = np.full(len(points), np.inf)
    for first in range(0, len(points), rows):
        some = points[first : first + rows]
        distances = cdist(some, centers)
        # Each triangle has a point at most this far, and none nearer than the other.
        bound = (distances + radii).min(axis=1)
        query, triangle = np.nonzero(distances - radii <= bound[:, None])
        near = distances_from_triangles(some[query], corners[triangle])
        np.minimum.at(least, first + query, near)
    return least


def distances_from_triangles(points: Floats, corners: Floats) -> Floats:
    """(m,) distance of each of points (m, 3) from the triangle of its row (m, 3, 3), which may be
    flat."""
    least = _above_faces(points, corners)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, end] - corners[:, start]
        length = (edge * edge).sum(-1)
        along = ((points - corners[:, start]) * edge).sum(-1)
        part = np.clip(along / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        beside = norms(corners[:, start] + part[:, None] * edge - points)
        least = np.minimum(least, beside)
    return least


def _above_faces(points: Floats, corners: Floats) -> Floats:
    """(m,) distances from the feet of the perpendiculars onto the planes of triangles; inf where
    the foot is outside, and for a flat triangle."""
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    normal = np.linalg.cross(opposite[:, 1], opposite[:, 2])
    squared = (normal * normal).sum(-1)
    arms = points[:, None] - np.roll(corners, -1, axis=1)
    # Times the squared length of the normal: weights of the corners whose mean is the foot.
    weights = (np.linalg.cross(opposite, arms) * normal[:, None]).sum(-1)
    inside = (squared > 0.0) & (weights >= 0.0).all(axis=1)
    heights = np.abs(((points - corners[:, 0]) * normal).sum(-1))
    result = np.full(len(points), np.inf)
    np.divide(heights, np.sqrt(squared), out=result, where=inside)
    return result
