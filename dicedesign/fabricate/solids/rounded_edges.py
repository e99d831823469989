"""Convex solids with rounded or chamfered edges and corners, whose flat facets are all that they
rest on.

A ball is rolled over a core: the solid is the hull of points at the radius from the core's corners.
Height over the table is then that of the core plus the radius, so that a perfectly round solid has
the odds of its core. Lengths are in one unit of any kind, as a rule millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from dicedesign.fabricate.solids.edge_options import EdgeOptions
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import foot_on_line, unit_vectors
from dicedesign.runtime.arrays import Floats

__all__ = ["rounded"]

TURN: Final = math.radians(11.0)
"""Largest angle between neighbouring flat strips of a fillet: no part of the angles of the regular
solids, so that a small change of a shape is a small change of its strips."""

SAME: Final = 2e-3
"""Directions nearer to each other than this, in radians, are one."""


def rounded(hull: ConvexHull, center: Floats, options: EdgeOptions) -> ConvexHull:
    """The solid that a ball rolled over a core fills, with flat strips in place of round ones.

    A flat strip could be rested on where the ideal round one is passed over: at a saddle, or at the
    top of a corner. So these directions are always edges or corners between strips, and a chamfer
    that has such a direction in its middle is made of two.

    hull: the core. center: (3,) the center of mass. Returns the hull of the solid.
    """
    turn = TURN if options.shape == "fillet" else math.pi
    arcs = _arcs(hull, center, turn)
    start, outgoing = hull.outgoing
    points = []
    for vertex, place in enumerate(hull.vertices):
        own = outgoing[start[vertex] : start[vertex + 1]]
        border = [arcs[edge] for edge in own.tolist()]
        # A corner is a top where all its edges lead down.
        edges = hull.vertices[hull.head[own]] - place
        is_top = bool((edges @ (place - center) < 0.0).all())
        normals = hull.normals[hull.facet[own]]
        middle = unit_vectors(place - center if is_top else normals.sum(axis=0))
        inside = _inside(middle, border, turn)
        if is_top and turn >= math.pi:
            inside = middle[None]
        points.append(place + options.radius_mm * np.concatenate([*border, inside]))
    return convex_hull(np.concatenate(points))


def _arcs(hull: ConvexHull, center: Floats, turn: float) -> list[Floats]:
    """For each half-edge directions (a, 3) between the normals of the facets beside it, these
    included, with that of the saddle among them."""
    arcs: list[Floats] = [np.empty((0, 3))] * len(hull.tail)
    radii = hull.vertices - center
    for edge, twin in enumerate(hull.twin.tolist()):
        if edge > twin:
            continue
        ends = hull.normals[[hull.facet[edge], hull.facet[twin]]]
        tail, head = radii[hull.tail[edge]], radii[hull.head[edge]]
        saddle = unit_vectors(foot_on_line(tail, head, head - tail, np))
        stops = [ends[0], ends[1]]
        if _between(saddle, ends):
            stops.insert(1, saddle)
        directions = [stops[0][None]]
        for one, other in pairwise(stops):
            directions.append(_along(one, other, turn)[1:])
        arcs[edge] = arcs[twin] = np.concatenate(directions)
    return arcs


def _between(direction: Floats, ends: Floats) -> bool:
    """Whether a direction on the great circle of two ends lies between them, and near to neither:
    beside a normal nothing can be rested on but the facet."""
    nearest = float((ends @ direction).min())
    apart = float(np.linalg.norm(ends - direction, axis=1).min())
    return nearest > float(ends[0] @ ends[1]) and apart > SAME


def _along(one: Floats, other: Floats, turn: float) -> Floats:
    """Directions (a, 3) from one to another, at equal angles of at most a turn."""
    angle = math.acos(min(max(float(one @ other), -1.0), 1.0))
    count = max(1, math.ceil(angle / turn))
    if angle < SAME:
        return np.stack([one, other])
    parts = np.linspace(0.0, 1.0, count + 1)[:, None]
    directions = np.sin((1.0 - parts) * angle) * one + np.sin(parts * angle) * other
    return np.asarray(directions / math.sin(angle), dtype=np.float64)


def _inside(middle: Floats, border: Sequence[Floats], turn: float) -> Floats:
    """Directions (a, 3) within the cone of a corner's normals: one in the middle, and others on the
    ways from there to its border, arcs of (m, 3), on fewer of them nearer to the middle, where they
    crowd.

    Which ways these are depends on numbers of directions alone, counted from the ends of each arc,
    so that a small change of the shape is a small change of its strips.
    """
    if turn >= math.pi:
        return np.empty((0, 3))
    directions = [middle[None]]
    for arc in border:
        for place, end in enumerate(arc):
            from_end = min(place, len(arc) - 1 - place)
            way = _along(middle, end, turn)
            steps = [
                step
                for step in range(1, len(way) - 1)
                if from_end % round((len(way) - 1) / step) == 0
            ]
            directions.append(way[steps])
    return np.concatenate(directions)
