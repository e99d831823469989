"""Random points in a body, and in the walls around its pockets."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Booleans, Floats

FLAT_MM = 1e-4
"""Tolerance on the depth of the floor of a pocket."""


def points_inside(hull: ConvexHull, count: int) -> Floats:
    """Select the points inside a body from `count` random points in its bounding box."""
    rng = np.random.default_rng(7)
    points = rng.uniform(hull.vertices.min(0), hull.vertices.max(0), size=(count, 3))
    return points[(depths(hull, points) >= 0.0).all(axis=1)]


def depths(hull: ConvexHull, points: Floats) -> Floats:
    """(n, m) depths of points below the facets of a hull."""
    return hull.heights(np.zeros(3)) - points @ hull.normals.T


def in_pocket_walls(
    surface: Surface, hull: ConvexHull, points: Floats, depth: float, walls: float
) -> Booleans:
    """Whether points (n, 3) are within a wall of the floor of a pocket in the finished mesh."""
    below = depths(hull, points)
    corners = surface.points[surface.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= norms(across)[:, None]
    inside = np.zeros(len(points), dtype=bool)
    for facet, normal in enumerate(hull.normals):
        levels = hull.heights(np.zeros(3))[facet] - corners @ normal
        floor = (np.abs(levels - depth) < FLAT_MM).all(axis=1) & (across @ normal > 0.999)
        near = np.flatnonzero(below[:, facet] < depth + walls)
        if floor.any():
            lifted = points[near] + (below[near, facet] - depth)[:, None] * normal
            offsets = distances_from_surface(
                Surface(surface.points, surface.triangles[floor]), lifted
            )
            inside[near] |= offsets < walls
    return inside
