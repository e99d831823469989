"""Convex solids with rounded or chamfered edges and corners, whose flat facets are all that they
rest on.

A ball is rolled over a core: the solid is the hull of points at the radius from the core's corners.
Height over the table is then that of the core plus the radius, so that a perfectly round solid has
the odds of its core. Lengths are in one unit of any kind, as a rule millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.fabricate.finish_options import EdgeOptions
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import foot_on_line, unit_vectors
from dicedesign.runtime.arrays import Floats, Integers

TURN: Final = math.radians(11.0)
"""Largest angle between neighbouring flat strips of a fillet: no part of the angles of the regular
solids, so that a small change of a shape is a small change of its strips."""

NEAR: Final = 0.02
"""Least distance between two points, over the radius."""

SAME: Final = 2e-3
"""The same between points that keep the solid from resting where it should not."""


def rounded(hull: ConvexHull, center: Floats, options: EdgeOptions) -> ConvexHull:
    """The solid that a ball rolled over a core fills, with flat strips in place of round ones.

    A flat strip could be rested on where the ideal round one is passed over: at a saddle, or at the
    top of a corner. So these directions are always edges or corners between strips, and a chamfer
    that has such a direction in its middle is made of two.

    hull: the core. center: (3,) the center of mass. Returns the hull of the solid.
    """
    turn = TURN if options.shape == "fillet" else math.pi
    saddles, arcs = _arcs(hull, center, turn)
    start, outgoing = hull.outgoing
    # Corners of facets, then what must not be rested on, then the rest.
    kinds: tuple[list[Floats], ...] = ([], [], [])
    for vertex, place in enumerate(hull.vertices):
        own = outgoing[start[vertex] : start[vertex + 1]]
        normals = hull.normals[hull.facet[own]]
        # A corner is a top where all its edges lead down.
        edges = hull.vertices[hull.head[own]] - place
        is_top = bool((edges @ (place - center) < 0.0).all())
        middle = unit_vectors(place - center if is_top else normals.sum(axis=0))
        border = [arcs[edge] for edge in own.tolist()]
        tops = middle[None] if is_top else np.empty((0, 3))
        passed = np.concatenate([tops, *(saddles[edge] for edge in own.tolist())])
        for kind, directions in zip(
            kinds, (normals, passed, _inside(middle, border, turn)), strict=True
        ):
            kind.append(place + options.radius_mm * directions)
    corners, passed, others = (np.concatenate(kind) for kind in kinds)
    points = _spread(corners, passed, SAME * options.radius_mm)
    return convex_hull(_spread(points, others, NEAR * options.radius_mm))


def _spread(points: Floats, others: Floats, least: float) -> Floats:
    """Points (n, 3), and of others (m, 3) those that are farther than a distance from them and from
    each other: slivers between crowded points would be all that a file in single precision tells.
    """
    together = np.concatenate([points, others])
    kept = np.ones(len(together), dtype=bool)
    pairs = cKDTree(together).query_pairs(least, output_type="ndarray")
    for one, other in sorted(map(tuple, np.sort(pairs, axis=1).tolist())):
        if kept[one] and other >= len(points):
            kept[other] = False
    return together[kept]


def _arcs(
    hull: ConvexHull, center: Floats, turn: float
) -> tuple[list[Floats], list[tuple[Floats, Integers]]]:
    """For each half-edge directions between the normals of the facets beside it: (0 or 1, 3) that
    of the saddle; and (a, 3) all, the normals included, with their numbers (a,), 0 for the saddle.
    """
    none = np.empty((0, 3))
    saddles = [none] * len(hull.tail)
    arcs = [(none, np.empty(0, dtype=np.int64))] * len(hull.tail)
    radii = hull.vertices - center
    for edge, twin in enumerate(hull.twin.tolist()):
        if edge > twin:
            continue
        ends = hull.normals[[hull.facet[edge], hull.facet[twin]]]
        tail, head = radii[hull.tail[edge]], radii[hull.head[edge]]
        saddle = unit_vectors(foot_on_line(tail, head, head - tail, np))
        directions, first = _along(ends[0], ends[1], turn), 0
        if _between(saddle, ends):
            saddles[edge] = saddles[twin] = saddle[None]
            before, after = _along(ends[0], saddle, turn), _along(saddle, ends[1], turn)
            directions, first = np.concatenate([before, after[1:]]), 1 - len(before)
        arcs[edge] = arcs[twin] = directions, np.arange(first, first + len(directions))
    return saddles, arcs


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


def _inside(middle: Floats, border: Sequence[tuple[Floats, Integers]], turn: float) -> Floats:
    """Directions (a, 3) of strips at a corner: those of the arcs on the border of the cone of its
    normals, and some between these and its middle, about as far apart."""
    directions = [arc for arc, _ in border]
    if turn >= math.pi:
        return np.concatenate(directions)
    directions.append(middle[None])
    for arc, numbers in border:
        for number, direction in zip(numbers.tolist(), arc, strict=True):
            path = _along(middle, direction, turn)
            # Every second, fourth, ... of the paths goes on where they come together, that from
            # the saddle to the end.
            parts = np.arange(1, len(path) - 1) / (len(path) - 1)
            strides = 2.0 ** np.floor(-np.log2(parts))
            directions.append(path[1:-1][number % strides == 0])
    return np.concatenate(directions)
