"""Lines as thin strips of triangles: lines of their own take a browser far longer to draw."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, norms, unit_vectors
from dicedesign.report.charts.hemispheres import great_arcs
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["NOTHING", "arc_ribbons", "edge_ribbons"]

LONGEST_PIECE: Final = 0.12
"""Radians of a straight piece of an arc."""

MOST_EDGES: Final = 400
"""Of a hull whose edges are drawn; those of others lie too close."""

Mesh = tuple[Floats, Integers]
"""Points (n, 3) and triangles (t, 3)."""

NOTHING: Final[Mesh] = (np.zeros((3, 3)), np.array([[0, 1, 2]]))
"""A mesh that is not seen: a browser wants one triangle."""


def arc_ribbons(paths: tuple[Floats, ...], radius: float, width: float) -> Mesh:
    """Polylines of unit directions, each (m, 3), as strips along a sphere of a radius."""
    if not paths:
        return NOTHING
    starts = np.concatenate([path[:-1] for path in paths])
    ends = np.concatenate([path[1:] for path in paths])
    pieces = np.ceil(angle_between(starts, ends) / LONGEST_PIECE).astype(np.int64)
    corners = []
    for count in np.unique(pieces[pieces > 0]).tolist():
        arcs = great_arcs(starts[pieces == count], ends[pieces == count], count)
        aside = 0.5 * width * unit_vectors(np.linalg.cross(arcs[:, 0], arcs[:, -1]))[:, None]
        left, right = radius * arcs + aside, radius * arcs - aside
        quads = [left[:, :-1], right[:, :-1], right[:, 1:], left[:, 1:]]
        corners.append(np.stack(quads, axis=2).reshape(-1, 4, 3))
    return _quads(np.concatenate(corners)) if corners else NOTHING


def edge_ribbons(hull: ConvexHull, points: Floats, width: float) -> Mesh:
    """The edges of a hull whose corners are at points (n, 3), as strips along each of its facets, a
    little above them; nothing where there are too many."""
    if len(hull.tail) > 2 * MOST_EDGES:
        return NOTHING
    up = hull.normals[hull.facet]
    start, end = points[hull.tail], points[hull.head]
    inward = unit_vectors(np.linalg.cross(up, end - start))
    # The border of a small facet is narrower.
    shortest = np.minimum.reduceat(norms(end - start), hull.facet_start[:-1])
    wide = np.minimum(width, 0.1 * shortest[hull.facet])[:, None]
    lift = 0.002 * up
    quads = [start + lift, end + lift, end + lift + wide * inward, start + lift + wide * inward]
    return _quads(np.stack(quads, axis=1))


def _quads(corners: Floats) -> Mesh:
    """Quadrilaterals (q, 4, 3) as two triangles each."""
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = (4 * np.arange(len(corners))[:, None, None] + halves).reshape(-1, 3)
    return corners.reshape(-1, 3), triangles
