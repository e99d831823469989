"""The hull of points that moved a little: a check of its old facets is cheaper than a new hull."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import (
    REUSE_FLATNESS,
    REUSE_LEVERAGE,
    REUSE_MARGIN,
    REUSE_OFFSET,
    REUSE_TURN,
)

HullMaker = Callable[[Floats], ConvexHull]
"""`convex_hull`, or `HullMemory.hull`, which finds the same hulls."""

CONNECTIVITY: Final = ("facet", "next", "previous", "head", "outgoing", "triangles")
"""Cached attributes of a hull that do not depend on where its vertices are."""

KEPT: Final = frozenset(("facet_start", "tail", "twin", *CONNECTIVITY))
"""Those, and the fields that do not."""

MOST_INSIDE: Final = 64
"""Number of points inside a hull above which none is looked at: it would take more time and memory
than a new hull."""


@dataclass
class HullMemory:
    """Convex hulls of points that change little from one time to the next.

    Attributes
    ----------
    built: hulls that were computed from scratch.
    reused: hulls that have the connectivity of the one before.
    """

    built: int = 0
    reused: int = 0
    _last: ConvexHull | None = field(default=None, repr=False)

    def hull(self, points: Floats) -> ConvexHull:
        """`convex_hull(points)` bit for bit, with the same errors; points: (n, 3) float64."""
        hull = None if self._last is None else same_connectivity(self._last, points)
        if hull is None:
            hull = convex_hull(points)
            self.built += 1
        else:
            self.reused += 1
        self._last = hull
        return hull


def same_connectivity(hull: ConvexHull, points: Floats) -> ConvexHull | None:
    """The hull of points, if it certainly has the facets of a given hull.

    The surface with those facets is checked edge by edge: facets are flat with convex corners, all
    edges bend inward, and the mean of the vertices sees the surface once in every direction. Such a
    surface bounds a convex body. All of this holds with so much room (the `REUSE_...` tolerances)
    that neither rounding nor the coplanar tolerance lets `convex_hull` find another one.

    Parameters
    ----------
    hull: the hull before its points moved.
    points: (n, 3) float64, in the order of those that the hull was made from, or one for each of
        its vertices.

    Returns
    -------
    `convex_hull(points)` bit for bit, or None where that is in doubt.

    Source: Mehlhorn et al., "Checking geometric programs or verification of geometric structures",
    Comput. Geom. 12, 1999.
    """
    source = hull.source
    if len(points) == len(source):
        source = np.arange(len(points))
    if not source[-1] < len(points) <= len(source) + MOST_INSIDE:
        return None
    attributes = kernels.moved_hull(points, source, hull.facet_start, hull.tail, hull.twin)
    if attributes is not None:
        return _moved(hull, source, attributes) if attributes else None
    lower, upper = points.min(axis=0), points.max(axis=0)
    scale = float((upper - lower).max()) / 2.0
    # False too where a number is missing or infinite.
    if not max(float(upper.max()), -float(lower.min())) <= REUSE_OFFSET * scale < np.inf:
        return None
    moved = ConvexHull(points[source], source, hull.facet_start, hull.tail, hull.twin)
    moved.__dict__.update({name: getattr(hull, name) for name in CONNECTIVITY})
    with np.errstate(all="ignore"):
        if not _is_convex(moved, scale):
            return None
        others = np.delete(points, source, axis=0) if len(points) > len(source) else points[:0]
        return moved if _contains(moved, others, scale) else None


def _moved(hull: ConvexHull, source: Integers, attributes: dict[str, Any]) -> ConvexHull:
    """The hull with the vertices and measures that a kernel found."""
    kept = {name: value for name, value in hull.__dict__.items() if name in KEPT}
    return ConvexHull.with_attributes({**kept, "source": source, **attributes})


def _is_convex(hull: ConvexHull, scale: float) -> bool:
    """Whether the facets certainly bound a convex body; lengths are measured in units of scale."""
    first, facet, tail, twin = hull.facet_start[:-1], hull.facet, hull.tail, hull.twin
    position = (hull.vertices - hull.vertices.mean(axis=0)) / scale
    start, end = position.take(tail, axis=0), position.take(hull.head, axis=0)
    normal = hull.normals.take(facet, axis=0)
    height = _dot(normal, start)
    level = height[first][facet]
    if not np.abs(height - level).max() <= REUSE_FLATNESS:
        return False
    edge = end - start
    after = edge.take(hull.next, axis=0)
    angle = np.arctan2(_determinant(normal, edge, after), _dot(edge, after))
    if not (angle.min() >= REUSE_TURN and np.add.reduceat(angle, first).max() <= 3.0 * np.pi):
        return False
    # In a convex polygon, the corner nearest to an edge's line is one beside the edge.
    before, behind = tail[hull.previous[twin]], hull.head[hull.next[twin]]
    depth = np.minimum(
        level - _dot(normal, position.take(before, axis=0)),
        level - _dot(normal, position.take(behind, axis=0)),
    )
    # No edge is shorter than the smallest depth: its end is that near to the edge beside it.
    if not min(depth.min(), level.min()) >= REUSE_MARGIN:
        return False
    length = np.sqrt(_dot(edge, edge))
    lever = np.minimum(length, (hull.areas / (np.diff(hull.facet_start) * scale**2))[facet])
    if not (depth * lever).min() >= REUSE_LEVERAGE:
        return False
    # A surface that winds around its middle twice is met twice by a ray from there.
    ray = start[: hull.facet_start[1]].mean(axis=0)
    side = _determinant(start, end, ray)
    return int((np.minimum.reduceat(side, first) >= -REUSE_FLATNESS).sum()) == 1


def _contains(hull: ConvexHull, points: Floats, scale: float) -> bool:
    """Whether points (n, 3) are certainly inside a convex hull."""
    anchor = hull.vertices[hull.tail[hull.facet_start[:-1]]]
    heights = points @ hull.normals.T - _dot(anchor, hull.normals)
    return bool((heights <= -REUSE_MARGIN * scale).all())


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("ij,ij->i", a, b)


def _determinant(a: Floats, b: Floats, c: Floats) -> Floats:
    """a . (b x c) of rows (n, 3), or of one vector (3,)."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a.T, b.T, c.T
    return ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
