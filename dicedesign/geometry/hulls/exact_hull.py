"""The convex hull of points as they are given, to the last bit.

Qhull's triangles are a proposal. They are verified in exact arithmetic; corners at which they are
not convex are taken out, and all that then lies outside is put in again by the incremental step,
whose only question is on which side of a triangle a point lies. A point in a triangle's plane
counts as one that sees it: then the triangles that a point sees are a disc, and those put in their
place are never degenerate, whether the point repeats another, lies on an edge or inside a facet.
Source of the incremental step: Preparata and Shamos, Computational Geometry, 1985, section 3.4.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import QhullError

from dicedesign.geometry.hulls.qhull import hull_triangles
from dicedesign.geometry.integers import Vector, cross, dot, minus
from dicedesign.geometry.predicates import Orientation
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import edge_neighbors
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import ROUNDING

__all__ = ["exact_facets"]

PLANE_ROUNDING = 16.0 * ROUNDING
"""Bound on how wrong the height of a point above a triangle is, when coordinates are at most 1 and
rounded: relative to the longest side of the triangle, heights being multiplied by its doubled
area."""

RAY_ROUNDING = 64.0 * PLANE_ROUNDING
"""Bound on the rounding error of a determinant of differences of such coordinates."""

BLOCK = 1 << 21
"""Pairs of a point and a triangle that are looked at together."""


def exact_facets(points: Floats, scaled: Floats) -> tuple[Integers, Integers, Integers] | None:
    """The convex hull as triangles, none of them degenerate, and which of them form one facet.

    points: (n, 3), finite; scaled: (n, 3) the same moved and scaled along the axes so that
    coordinates are at most 1, rounded.

    Returns triangles (t, 3), counter-clockwise seen from outside, their neighbours (t, 3) across
    the edge opposite to each corner, and facet numbers (t,) from 0; None where all points lie on
    one plane. Facets are exactly flat, and edges between two of them exactly convex.
    """
    sides = Orientation(points)
    start = _verified_proposal(sides, scaled)
    if start is None:
        start = _simplex(sides, scaled, np.arange(len(points)))
    if start is None:
        return None
    surface = _Surface(sides, scaled, start)
    corner = np.zeros(len(points), dtype=bool)
    corner[start] = True
    outside = np.flatnonzero(~corner)
    while len(outside):
        outside, farthest = surface.outside(outside)
        for point in farthest:
            surface.add(int(point))
    triangles = surface.triangles
    neighbors = edge_neighbors(triangles)
    left, right, bends = _bends(sides, triangles, neighbors)
    flat = bends == 0
    graph = coo_array(
        (np.ones(int(flat.sum())), (left[flat], right[flat])), shape=(len(triangles),) * 2
    )
    return triangles, neighbors, connected_components(graph, directed=False)[1].astype(np.int64)


def _verified_proposal(sides: Orientation, scaled: Floats) -> Integers | None:
    """Triangles (t, 3) of a convex polyhedron with corners among the points, or None."""
    kept = np.arange(len(scaled))
    while len(kept) >= 4:
        try:
            triangles = kept[hull_triangles(scaled[kept])[0]]
        except QhullError:
            return None
        corners = np.unique(triangles)
        simplex = _simplex(sides, scaled, corners)
        if simplex is None:
            return None
        faulty = _faulty(sides, triangles, np.unique(simplex))
        if len(faulty) == 0:
            covers = _covers_once(sides, scaled, triangles, np.unique(simplex))
            return triangles if covers else None
        kept = np.setdiff1d(corners, faulty)
    return None


def _faulty(sides: Orientation, triangles: Integers, inside: Integers) -> Integers:
    """Corners of triangles (t, 3) that lack a neighbour, bend inward, or do not have all of some
    points `inside` (4,), which span a solid, below or on their planes."""
    neighbors = edge_neighbors(triangles)
    if (neighbors < 0).any():
        return np.unique(triangles[(neighbors < 0).any(axis=1)])
    heights = np.stack(
        [sides.signs(triangles, np.full(len(triangles), point)) for point in inside], axis=1
    )
    bad = (heights > 0).any(axis=1) | (heights == 0).all(axis=1)
    left, right, bends = _bends(sides, triangles, neighbors)
    bad[left[bends > 0]] = True
    bad[right[bends > 0]] = True
    return np.unique(triangles[bad])


def _bends(
    sides: Orientation, triangles: Integers, neighbors: Integers
) -> tuple[Integers, Integers, Integers]:
    """The two triangles at each edge, and -1 where it is convex, 0 flat, 1 reflex."""
    beyond = triangles[neighbors].sum(axis=2) - (triangles.sum(axis=1)[:, None] - triangles)
    left, corner = np.nonzero(neighbors > np.arange(len(triangles))[:, None])
    bends = sides.signs(triangles[left], beyond[left, corner])
    return left, neighbors[left, corner], bends


def _covers_once(sides: Orientation, scaled: Floats, triangles: Integers, inside: Integers) -> bool:
    """Whether a ray from the mean of points `inside` (4,), below all triangles (t, 3), meets only
    one triangle. As none is seen from behind, they then surround it once, and a closed surface
    that is convex at every edge bounds a convex body."""
    corners = scaled[triangles] - scaled[inside].mean(axis=0)
    ray = corners[0].sum(axis=0)
    turns = [np.linalg.cross(corners[:, k - 1], corners[:, k]) @ ray for k in range(3)]
    near = np.flatnonzero(np.min(turns, axis=0) >= -RAY_ROUNDING)
    total = _sum(*(sides.integers[int(point)] for point in inside))

    def spanned(triangle: int) -> list[Vector]:
        integers = (sides.integers[int(point)] for point in triangles[triangle])
        return [minus((4 * x, 4 * y, 4 * z), total) for x, y, z in integers]

    exact_ray = _sum(*spanned(0))
    met = 0
    for triangle in near:
        edges = spanned(int(triangle))
        met += all(dot(cross(edges[k - 1], edges[k]), exact_ray) >= 0 for k in range(3))
    return met == 1


def _sum(*vectors: Vector) -> Vector:
    x, y, z = (sum(values) for values in zip(*vectors, strict=True))
    return x, y, z


def _simplex(sides: Orientation, scaled: Floats, among: Integers) -> Integers | None:
    """Triangles (4, 3) of a tetrahedron with corners among points (k,), or None where those lie on
    one plane."""
    local = scaled[among] - scaled[among[0]]
    second = int(np.argmax(norms(local)))
    a, b = int(among[0]), int(among[second])
    turns = np.linalg.cross(local, local[second])
    by_area = among[np.argsort(-norms(turns), kind="stable")]
    c = next((int(p) for p in by_area if not sides.collinear(a, b, int(p))), None)
    if c is None:
        return None
    normal = np.linalg.cross(local[second], scaled[c] - scaled[a])
    by_height = among[np.argsort(-np.abs(local @ normal), kind="stable")]
    base = np.array([[a, b, c]])
    for tried in (by_height[:1], by_height[1:]):
        signs = sides.signs(np.repeat(base, len(tried), axis=0), tried)
        solid = np.flatnonzero(signs)
        if len(solid):
            d = int(tried[solid[0]])
            if signs[solid[0]] > 0:
                b, c = c, b
            return np.array([[a, b, c], [a, d, b], [b, d, c], [c, d, a]])
    return None


class _Surface:
    """A convex polyhedron that grows."""

    def __init__(self, sides: Orientation, scaled: Floats, triangles: Integers) -> None:
        self._sides = sides
        self._scaled = scaled
        self.triangles = triangles
        self._normals, self._offsets, self._bounds = self._planes(triangles)

    def _planes(self, triangles: Integers) -> tuple[Floats, Floats, Floats]:
        a, b, c = (self._scaled[triangles[:, k]] for k in range(3))
        normals = np.linalg.cross(b - a, c - a).astype(np.float64)
        longest = np.maximum(np.abs(b - a), np.abs(c - a)).max(axis=1)
        bounds = PLANE_ROUNDING * longest + np.finfo(np.float64).tiny
        return normals, (normals * a).sum(-1), bounds

    def outside(self, candidates: Integers) -> tuple[Integers, Integers]:
        """Those of some points (k,) that lie outside, and the highest above each triangle."""
        found, above, heights = [], [], []
        planes = np.column_stack([self._normals, self._bounds - self._offsets])
        local = np.column_stack([self._scaled[candidates], np.ones(len(candidates))])
        blocks = 1 + len(candidates) * len(self.triangles) // BLOCK
        near = [(planes @ part.T).max(axis=0) >= 0.0 for part in np.array_split(local, blocks)]
        candidates = candidates[np.concatenate(near)]
        for block in np.array_split(candidates, blocks):
            values = self._scaled[block] @ self._normals.T - self._offsets
            out: Booleans = np.asarray((values > self._bounds).any(axis=1))
            row, facet = np.nonzero((values >= -self._bounds) & ~out[:, None])
            signs = self._sides.signs(self.triangles[facet], block[row])
            out[row[signs > 0]] = True
            found.append(block[out])
            above.append(np.argmax(values[out], axis=1))
            heights.append(values[out].max(axis=1, initial=-np.inf))
        points, facets = np.concatenate(found), np.concatenate(above)
        order = np.lexsort((np.concatenate(heights), facets))
        last = np.flatnonzero(np.diff(facets[order], append=-1))
        return points, points[order[last]]

    def add(self, point: int) -> None:
        """The hull of the polyhedron and a point."""
        values = self._normals @ self._scaled[point] - self._offsets
        seen = values > 0.0
        unsure = np.flatnonzero(np.abs(values) <= self._bounds)
        seen[unsure] = self._sides.signs(self.triangles[unsure], np.full(len(unsure), point)) >= 0
        visible = self.triangles[seen]
        tail, head = visible.ravel(), np.roll(visible, -1, axis=1).ravel()
        size = np.int64(len(self._scaled))
        horizon = ~np.isin(tail * size + head, head * size + tail)
        fan = np.stack([tail[horizon], head[horizon], np.full(horizon.sum(), point)], axis=1)
        self.triangles = np.concatenate([self.triangles[~seen], fan])
        self._normals, self._offsets, self._bounds = (
            np.concatenate([old[~seen], new])
            for old, new in zip(
                (self._normals, self._offsets, self._bounds), self._planes(fan), strict=True
            )
        )
