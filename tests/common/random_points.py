"""Points at random in a body, and those of them in the walls around its pockets."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Booleans, Floats

FLAT = 1e-4
"""In mm."""


def drawn(hull: ConvexHull, count: int) -> Floats:
    """Points all over a body, at random: those of `count` in the box about it."""
    rng = np.random.default_rng(7)
    points = rng.uniform(hull.vertices.min(0), hull.vertices.max(0), size=(count, 3))
    return points[(depths(hull, points) >= 0.0).all(axis=1)]


def depths(hull: ConvexHull, points: Floats) -> Floats:
    """(n, m) below the facets of a hull."""
    return hull.heights(np.zeros(3)) - points @ hull.normals.T


def in_pocket_walls(
    surface: Surface, hull: ConvexHull, points: Floats, depth: float, walls: float
) -> Booleans:
    """Whether points (n, 3) are no more than walls below the floor of a pocket, by the finished
    mesh, and no more than that beside it."""
    below = depths(hull, points)
    corners = surface.points[surface.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= norms(across)[:, None]
    found = np.zeros(len(points), dtype=bool)
    for facet, normal in enumerate(hull.normals):
        levels = hull.heights(np.zeros(3))[facet] - corners @ normal
        floor = (np.abs(levels - depth) < FLAT).all(axis=1) & (across @ normal > 0.999)
        near = np.flatnonzero(below[:, facet] < depth + walls)
        if floor.any():
            lifted = points[near] + (below[near, facet] - depth)[:, None] * normal
            beside = distances_from_surface(
                Surface(surface.points, surface.triangles[floor]), lifted
            )
            found[near] |= beside < walls
    return found
