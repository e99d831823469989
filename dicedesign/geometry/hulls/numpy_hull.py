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
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial import QhullError, cKDTree

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.predicates import Orientation
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors, edge_neighbors
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges
from dicedesign.tolerances import COPLANAR_WIDENINGS, FLATNESS_TOLERANCE, ROUNDING


def hull_triangles(points: Floats) -> tuple[Integers, Integers]:
    """Triangles (t, 3) of the hull of points (n, 3), counter-clockwise seen from outside, and their
    neighbours (t, 3): `neighbors[t, k]` lies across the edge opposite to corner k.

    Raises scipy's QhullError where the points span no solid.
    """
    qhull = _qhull(points)
    triangles = qhull.simplices.astype(np.int64)
    neighbors = qhull.neighbors.astype(np.int64)
    outward = (doubled_area_vectors(points, triangles) * qhull.equations[:, :3]).sum(-1)
    flip = outward < 0.0
    if (_edge_parity(triangles, neighbors) != (flip[:, None] ^ flip[neighbors])).any():
        flip = _propagated_flip(triangles, neighbors, outward)
    triangles[flip] = triangles[flip][:, [0, 2, 1]]
    neighbors[flip] = neighbors[flip][:, [0, 2, 1]]
    return triangles, neighbors


def _qhull(points: Floats) -> QhullHull:
    """Hull triangles by Qhull. Where clusters of points make it give up on a facet that became
    wider than rounding explains, it is asked to go on: flat triangles are merged here anyway."""
    try:
        return QhullHull(points)
    except QhullError:
        return QhullHull(points, qhull_options="Qt Q12 Pp")


def _edge_parity(triangles: Integers, neighbors: Integers) -> NDArray[np.bool_]:
    """(t, 3) True where a triangle and its neighbour run along their common edge in the same
    direction, so that exactly one of the two must be turned."""
    parity = np.empty(triangles.shape, dtype=bool)
    for k in range(3):
        start, end = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        other = triangles[neighbors[:, k]]
        position = np.argmax(other == start[:, None], axis=1)
        parity[:, k] = other[np.arange(len(other)), (position + 1) % 3] == end
    return parity


def _propagated_flip(
    triangles: Integers, neighbors: Integers, outward: Floats
) -> NDArray[np.bool_]:
    """Turn every triangle consistently with the one whose orientation is clearest (slivers have
    normals that are only rounding noise)."""
    parity = _edge_parity(triangles, neighbors)
    start = int(np.argmax(np.abs(outward)))
    flip = np.zeros(len(triangles), dtype=bool)
    flip[start] = outward[start] < 0.0
    seen = np.zeros(len(triangles), dtype=bool)
    seen[start] = True
    stack = [start]
    while stack:
        t = stack.pop()
        for k in range(3):
            other = int(neighbors[t, k])
            if not seen[other]:
                seen[other] = True
                flip[other] = flip[t] ^ parity[t, k]
                stack.append(other)
    return flip


def facet_labels(
    points: Floats, triangles: Integers, neighbors: Integers, tolerance: float
) -> Integers:
    """Facet number of each triangle: all corners of a facet lie within `tolerance` of the plane of
    its largest triangle.

    points: (n, 3); triangles: (t, 3) counter-clockwise seen from outside; neighbors: (t, 3) across
    the edge opposite to each corner; tolerance: a length. Returns (t,) integers from 0.
    """
    doubled = doubled_area_vectors(points, triangles)
    area = norms(doubled)
    normals = doubled / np.maximum(area, np.finfo(np.float64).tiny)[:, None]
    left = np.repeat(np.arange(len(triangles)), 3)
    right = neighbors.ravel()
    # Measured from the larger triangle of each pair: a sliver has no normal worth the name.
    base = np.where(area[left] >= area[right], left, right)
    other = left + right - base
    gap = _distance(points, triangles, normals, base, other)
    joined = gap <= tolerance
    if not joined.any():
        return np.arange(len(triangles))
    while True:
        graph = coo_array(
            (np.ones(int(joined.sum())), (left[joined], right[joined])), shape=(len(triangles),) * 2
        )
        labels = connected_components(graph, directed=False)[1].astype(np.int64)
        # A chain of small bends is no facet: compare with the plane of each group's largest
        # triangle.
        largest = _largest(labels, area)
        drift = _distance(points, triangles, normals, largest[labels], np.arange(len(triangles)))
        for group in np.unique(labels[drift > tolerance]):
            labels = _grown(
                points, triangles, neighbors, normals, area, labels, int(group), tolerance
            )
        labels = np.unique(labels, return_inverse=True)[1].astype(np.int64)
        # A sliver among slivers finds no plane in its neighbours, but it does in their groups.
        largest = _largest(labels, area)
        base = largest[labels[right]]
        smaller = (labels[left] != labels[right]) & (area[largest[labels[left]]] < area[base])
        missed = smaller & (_distance(points, triangles, normals, base, left) <= tolerance)
        missed &= ~joined
        if not missed.any():
            return labels
        joined |= missed


def _largest(labels: Integers, area: Floats) -> Integers:
    """The largest triangle of each label."""
    order = np.argsort(area, kind="stable")
    largest = np.empty(int(labels.max()) + 1, dtype=np.int64)
    largest[labels[order]] = order
    return largest


def _distance(
    points: Floats, triangles: Integers, normals: Floats, base: Integers, other: Integers
) -> Floats:
    """Largest distance of the corners of `other` from the plane of `base`."""
    offset = points[triangles[other]] - points[triangles[base, 0]][:, None, :]
    return np.abs((offset * normals[base][:, None, :]).sum(-1)).max(axis=1)


def _grown(
    points: Floats,
    triangles: Integers,
    neighbors: Integers,
    normals: Floats,
    area: Floats,
    labels: Integers,
    group: int,
    tolerance: float,
) -> Integers:
    """Split one group into regions grown from its largest triangles outward."""
    members = np.flatnonzero(labels == group)
    labels = labels.copy()
    labels[members] = -1
    number = int(labels.max()) + 1
    for seed in members[np.argsort(-area[members], kind="stable")]:
        if labels[seed] != -1:
            continue
        labels[seed] = number
        front = [int(seed)]
        while front:
            for other in neighbors[front.pop()]:
                if labels[other] == -1:
                    index = np.array([other])
                    if _distance(points, triangles, normals, np.array([seed]), index) <= tolerance:
                        labels[other] = number
                        front.append(int(other))
        number += 1
    return labels


HalfEdges = tuple[Integers, Integers, Integers, Integers]
"""`source`, `facet_start`, `tail` and `twin` of a `ConvexHull`."""


def facet_loops(
    points: int, triangles: Integers, neighbors: Integers, labels: Integers
) -> HalfEdges | None:
    """Polygonal half-edge structure of labelled triangles, or None where it is no polyhedron.

    points: how many there are; triangles: (t, 3) of them, a closed surface, counter-clockwise seen
    from outside; neighbors: (t, 3) across the edge opposite to each corner; labels: (t,) facet of
    each triangle, from 0. Corners at which only two facets meet are left out.
    """
    border = labels[:, None] != labels[neighbors]
    triangle, corner = np.nonzero(border)
    tail = triangles[triangle, (corner + 1) % 3]
    head = triangles[triangle, (corner + 2) % 3]
    facet = labels[triangle]
    facets = int(labels.max()) + 1
    count = np.bincount(facet, minlength=facets)
    if len(tail) < 12 or (count < 3).any():
        return None
    # The follower of a half-edge starts, in the same facet, where it ends.
    size = np.int64(points)
    key = facet * size + tail
    order = np.argsort(key)
    found = np.minimum(np.searchsorted(key[order], facet * size + head), len(order) - 1)
    follower = order[found]
    if (key[follower] != facet * size + head).any():
        return None
    walk = _walk_facets(facet, follower, count)
    if walk is None:
        return None
    tail, facet = tail[walk], facet[walk]
    keep = np.bincount(tail, minlength=points)[tail] >= 3
    tail, facet = tail[keep], facet[keep]
    count = np.bincount(facet, minlength=facets)
    if (count < 3).any():
        return None
    facet_start = np.concatenate([[0], np.cumsum(count)])
    source, tail = np.unique(tail, return_inverse=True)
    facet_start, tail = _sorted_facets(facet_start, tail)
    following = np.arange(1, len(tail) + 1)
    following[facet_start[1:] - 1] = facet_start[:-1]
    size, head = np.int64(len(source)), tail[following]
    forward, backward = tail * size + head, head * size + tail
    order = np.argsort(forward)
    found = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    twin = order[found]
    if (forward[twin] != backward).any() or len(source) - len(tail) // 2 + facets != 2:
        return None
    return source, facet_start, tail, twin


def _sorted_facets(facet_start: Integers, tail: Integers) -> tuple[Integers, Integers]:
    """The same facets in the order that `ConvexHull` describes."""
    start, count = facet_start[:-1], np.diff(facet_start)
    owner = np.repeat(np.arange(len(count)), count)
    first = np.lexsort((tail, owner))[start] - start
    second = tail[start + (first + 1) % count]
    order = np.lexsort((second, tail[start + first]))
    facet, step = ragged_ranges(np.zeros(len(order), dtype=np.int64), count[order])
    old = order[facet]
    walk = start[old] + (first[old] + step) % count[old]
    return np.concatenate([[0], np.cumsum(count[order])]), tail[walk]


def _walk_facets(facet: Integers, follower: Integers, count: Integers) -> Integers | None:
    """Half-edges in walking order, facet by facet, or None if a facet's border is not one loop."""
    start = np.concatenate([[0], np.cumsum(count)])
    current = np.empty(len(count), dtype=np.int64)
    current[facet[::-1]] = np.arange(len(facet))[::-1]
    first = current.copy()
    walk = np.empty(len(facet), dtype=np.int64)
    active = np.arange(len(count))
    for step in range(int(count.max())):
        if step > 0 and (current[active] == first[active]).any():
            return None
        walk[start[active] + step] = current[active]
        current[active] = follower[current[active]]
        active = active[count[active] > step + 1]
    return walk if (current == first).all() else None


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
