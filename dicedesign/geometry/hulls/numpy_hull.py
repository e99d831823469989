"""Convex hulls in NumPy: for bodies about which the compiled kernels give up, for a coplanar
tolerance of 0, and for all bodies where kernels were not built.

Coplanar ones of Qhull's triangles are merged within a tolerance. At a tolerance of 0 the hull is
that of the points as they are given, to the last bit (`exact_facets`): from a tetrahedron on,
points outside are put in by the incremental step, whose only question is on which side of a
triangle a point lies. A point in a triangle's plane counts as one that sees it: then the triangles
that a point sees are a disc, and those put in their place are never degenerate, whether the point
repeats another, lies on an edge or inside a facet.
Source of the incremental step: Preparata and Shamos, Computational Geometry, 1985, section 3.4."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import QhullError, cKDTree

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.qhull import HalfEdges, facet_labels, facet_loops, hull_triangles
from dicedesign.geometry.predicates import Orientation
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import edge_neighbors
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import COPLANAR_WIDENINGS, FLATNESS_TOLERANCE, ROUNDING


def hull_half_edges(positions: Floats, coplanar_tolerance: float, precision: float) -> HalfEdges:
    """`source`, `facet_start`, `tail` and `twin` of the `ConvexHull` of points.

    positions: (n, 3); coplanar_tolerance: see `convex_hull`; precision: relative spacing of the
    coordinates. Raises DegenerateBodyError as `convex_hull`.
    """
    if len(positions) < 4:
        raise DegenerateBodyError(
            f"points: expected at least 4 that span a solid, got {len(positions)}; add points"
        )
    if not np.isfinite(positions).all():
        bad = int(np.flatnonzero(~np.isfinite(positions).all(axis=1))[0])
        raise DegenerateBodyError(
            f"points: expected finite coordinates, got {positions[bad].tolist()} in row {bad}; "
            "remove or repair that point"
        )
    lower, upper = positions.min(axis=0), positions.max(axis=0)
    # Halved before they are added: the sum of two large ones is no float.
    local = positions - (lower / 2.0 + upper / 2.0)
    scale = float(np.abs(local).max())
    if scale == 0.0:
        raise DegenerateBodyError(
            "points: expected points that span a solid, got one repeated; pass distinct points"
        )
    if coplanar_tolerance == 0.0:
        return _exact_half_edges(positions, local)
    magnitude = max(float(np.abs(lower).max()), float(np.abs(upper).max()))
    tolerance = coplanar_tolerance + 4.0 * precision * magnitude / scale
    kept, scaled = np.arange(len(positions)), local / scale
    while True:
        try:
            half_edges = _merged_half_edges(kept, scaled, tolerance)
        except QhullError as error:
            raise flat_error(scaled) from error
        if half_edges is None:
            break
        repeated = _repeated(scaled, kept, half_edges, tolerance)
        if len(repeated) == 0:
            return half_edges
        kept = np.setdiff1d(kept, repeated)
    if thickness(scaled) <= 2.0 * tolerance:
        raise flat_error(scaled)
    raise DegenerateBodyError(
        "points: expected facets that can be told apart, got none that make a polyhedron at a "
        f"coplanar tolerance of {coplanar_tolerance:g}; pass another coplanar_tolerance or remove "
        "points that nearly coincide"
    )


def _merged_half_edges(kept: Integers, scaled: Floats, tolerance: float) -> HalfEdges | None:
    """Hull of the kept points, or None where its facets make no polyhedron at any tolerance."""
    triangles, neighbors = hull_triangles(scaled[kept])
    triangles = kept[triangles]
    for factor in COPLANAR_WIDENINGS:
        labels = facet_labels(scaled, triangles, neighbors, factor * tolerance)
        half_edges = facet_loops(len(scaled), triangles, neighbors, labels)
        if half_edges is not None:
            return half_edges
    return None


def _exact_half_edges(positions: Floats, local: Floats) -> HalfEdges:
    """Hull whose facets are flat and whose edges are convex to the last bit."""
    extents = np.abs(local).max(axis=0)
    facets = exact_facets(positions, local / np.where(extents > 0.0, extents, 1.0))
    half_edges = None if facets is None else facet_loops(len(positions), *facets)
    if half_edges is None:
        raise flat_error(local / extents.max())
    return half_edges


def _repeated(points: Floats, kept: Integers, half_edges: HalfEdges, distance: float) -> Integers:
    """Kept points within a distance of a vertex of lower number, which stands for them; only those
    are looked for that make an edge so short."""
    source, _, tails, twins = half_edges
    tail, head = source[tails], source[tails[twins]]
    short = (norms(points[head] - points[tail]) <= distance) & (tail < head)
    if not short.any():
        return np.empty(0, dtype=np.int64)
    standing = np.setdiff1d(tail[short], head[short])
    close = cKDTree(points[kept]).query_ball_point(points[standing], distance)
    return np.setdiff1d(kept[np.concatenate(close).astype(np.int64)], standing)


def thickness(local: Floats) -> float:
    """Extent of points (n, 3) across the plane that fits them best."""
    across = np.linalg.svd(local - local.mean(axis=0), full_matrices=False)[2][-1]
    return float(np.ptp(local @ across))


def flat_error(local: Floats) -> DegenerateBodyError:
    """The error for points (n, 3) that span no solid, which says whether they span a plane."""
    extents = np.linalg.svd(local - local.mean(axis=0), compute_uv=False)
    rank = int((extents > FLATNESS_TOLERANCE * extents[0]).sum())
    where = {1: "on one line", 2: "on one plane"}.get(rank, "too close to one plane")
    return DegenerateBodyError(
        f"points: expected points that span a solid, got {len(local)} points {where}; "
        "a body needs thickness in all three directions"
    )


PLANE_ROUNDING = 16.0 * ROUNDING
"""Bound on how wrong the height of a point above a triangle is, when coordinates are at most 1 and
rounded: relative to the longest side of the triangle, heights being multiplied by its doubled
area."""

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
    start = _simplex(sides, scaled)
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


def _bends(
    sides: Orientation, triangles: Integers, neighbors: Integers
) -> tuple[Integers, Integers, Integers]:
    """The two triangles at each edge, and -1 where it is convex, 0 flat, 1 reflex."""
    beyond = triangles[neighbors].sum(axis=2) - (triangles.sum(axis=1)[:, None] - triangles)
    left, corner = np.nonzero(neighbors > np.arange(len(triangles))[:, None])
    bends = sides.signs(triangles[left], beyond[left, corner])
    return left, neighbors[left, corner], bends


def _simplex(sides: Orientation, scaled: Floats) -> Integers | None:
    """Triangles (4, 3) of a tetrahedron with corners among the points, or None where those lie on
    one plane."""
    local = scaled - scaled[0]
    a, b = 0, int(np.argmax(norms(local)))
    turns = np.linalg.cross(local, local[b])
    by_area = np.argsort(-norms(turns), kind="stable")
    c = next((int(p) for p in by_area if not sides.collinear(a, b, int(p))), None)
    if c is None:
        return None
    normal = np.linalg.cross(local[b], local[c])
    by_height = np.argsort(-np.abs(local @ normal), kind="stable")
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
