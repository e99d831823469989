"""Which triangles of a finished die belong to its labels: walls and floors of what is cut in."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import KDTree

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface, connected_parts, edge_neighbors
from dicedesign.runtime.arrays import Booleans, Floats

OFF: Final = 0.1
"""Distance of the middle of a triangle from the plain surface, over the depth of labels. That of a
wall with two corners on the surface is a third of the depth away, less where the surface slopes."""

PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a triangle and a facet that are compared at a time, to bound the memory."""

MATCHINGS: Final = 8
"""Rounds in which the plain surface is brought onto the other; three are usual."""

MATCHED: Final = 3.0
"""Corners that are nearer than so many times the median are taken for the same corner."""


def labels_below_hull(marked: Surface, depth: float) -> Booleans:
    """(t,) which triangles of a die that is convex but for its labels belong to these: those below
    its hull, but for a hollow inside.

    depth: of labels, above 0, in the unit of the surface.
    """
    hull = convex_hull(marked.points)
    middles = marked.points[marked.triangles].mean(axis=1)
    below = np.empty(len(middles))
    rows = max(1, PAIRS_AT_ONCE // len(hull.normals))
    for first in range(0, len(middles), rows):
        some = slice(first, first + rows)
        below[some] = hull.depths(middles[some]).min(axis=1)
    across = edge_neighbors(marked.triangles)
    one, edge = np.nonzero(across >= 0)
    part = connected_parts(one, across[one, edge], len(across))
    outside = np.isin(part, part[below <= OFF * depth])
    return (below > OFF * depth) & outside


def labels_off_surface(marked: Surface, plain: Surface, depth: float) -> Booleans:
    """(t,) which triangles of a die with labels belong to these: those off the surface of the plain
    die, of which it is an image under an affine map near the identity.

    marked, plain: the die with labels and without; depth: of labels, above 0; all in one unit.
    """
    points = _brought_onto(marked.points, plain.points)
    middles = points[marked.triangles].mean(axis=1)
    # Most triangles of a surface of many are as they were.
    apart, _ = KDTree(plain.points[plain.triangles].mean(axis=1)).query(middles)
    new = np.flatnonzero(apart > OFF * OFF * depth)
    labels = np.zeros(len(middles), dtype=bool)
    labels[new] = distances_from_surface(plain, middles[new]) > OFF * depth
    return labels


def _brought_onto(points: Floats, others: Floats) -> Floats:
    """Points (n, 3) under the affine map that brings some of them onto most of others (m, 3)."""
    homogeneous = np.column_stack([points, np.ones(len(points))])
    placed = points
    for _ in range(MATCHINGS):
        apart, nearest = KDTree(placed).query(others)
        same = apart <= MATCHED * np.median(apart)
        matrix, *_ = np.linalg.lstsq(homogeneous[nearest[same]], others[same])
        placed = homogeneous @ matrix
    return placed
