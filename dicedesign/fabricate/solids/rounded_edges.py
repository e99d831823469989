"""Convex solids with rounded or chamfered edges and corners, whose flat facets are all that they
rest on.

A ball is rolled over a core: the solid is the hull of points at the radius from the core's corners.
Height over the table is then that of the core plus the radius, so that a perfectly round solid has
the odds of its core. Lengths are in one unit of any kind, as a rule millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from dicedesign.fabricate.solids.edge_options import EdgeOptions
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import foot_on_line, unit_vectors
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["rounded"]

TURN: Final = math.radians(11.0)
"""Largest angle between neighbouring flat strips of a fillet: no part of the angles of the regular
solids, so that a small change of a shape is a small change of its strips."""

SAME_DIRECTION: Final = 1e-6
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
        # A corner is a top where all its edges lead down.
        edges = hull.vertices[hull.head[own]] - place
        if (edges @ (place - center) < 0.0).all():
            middle = unit_vectors(place - center)
        else:
            middle = unit_vectors(hull.normals[hull.facet[own]].sum(axis=0))
        border = [arcs[edge] for edge in own.tolist()]
        outer = [arc for arc, _ in border]
        directions = np.concatenate([*outer, *_inside(middle, border, turn), middle[None]])
        points.append(place + options.radius_mm * directions)
    return convex_hull(np.concatenate(points))


def _arcs(hull: ConvexHull, center: Floats, turn: float) -> list[tuple[Floats, Integers]]:
    """For each half-edge directions (a, 3) between the normals of the facets beside it, these
    included, with that of the saddle among them; and their numbers (a,), 0 for the saddle."""
    arcs = [(np.empty((0, 3)), np.empty(0, dtype=np.int64))] * len(hull.tail)
    radii = hull.vertices - center
    for edge, twin in enumerate(hull.twin.tolist()):
        if edge > twin:
            continue
        ends = hull.normals[[hull.facet[edge], hull.facet[twin]]]
        tail, head = radii[hull.tail[edge]], radii[hull.head[edge]]
        saddle = unit_vectors(foot_on_line(tail, head, head - tail, np))
        if _between(saddle, ends):
            before, after = _along(ends[0], saddle, turn), _along(saddle, ends[1], turn)
            directions, first = np.concatenate([before, after[1:]]), 1 - len(before)
        else:
            directions, first = _along(ends[0], ends[1], turn), 0
        arcs[edge] = arcs[twin] = directions, np.arange(first, first + len(directions))
    return arcs


def _between(direction: Floats, ends: Floats) -> bool:
    """Whether a direction on the great circle of two ends lies strictly between them."""
    cosine = float(ends[0] @ ends[1])
    nearest = float((ends @ direction).min())
    apart = float(np.linalg.norm(ends - direction, axis=1).min())
    return nearest > cosine and apart > SAME_DIRECTION


def _along(one: Floats, other: Floats, turn: float) -> Floats:
    """Directions (a, 3) from one to another, at equal angles of at most a turn."""
    angle = math.acos(min(max(float(one @ other), -1.0), 1.0))
    count = max(1, math.ceil(angle / turn))
    if angle < SAME_DIRECTION:
        return np.stack([one, other])
    parts = np.linspace(0.0, 1.0, count + 1)[:, None]
    directions = np.sin((1.0 - parts) * angle) * one + np.sin(parts * angle) * other
    return np.asarray(directions / math.sin(angle), dtype=np.float64)


def _inside(
    middle: Floats, border: Sequence[tuple[Floats, Integers]], turn: float
) -> Iterator[Floats]:
    """Directions (a, 3) between the middle of a corner's cone of normals and the arcs on its
    border, about as far apart as on these."""
    for arc, numbers in border:
        for number, direction in zip(numbers.tolist(), arc, strict=True):
            path = _along(middle, direction, turn)
            # Every second, fourth, ... of the paths goes on where they come together, that from
            # the saddle to the end.
            parts = np.arange(1, len(path) - 1) / (len(path) - 1)
            strides = 2.0 ** np.floor(-np.log2(parts))
            yield path[1:-1][number % strides == 0]
