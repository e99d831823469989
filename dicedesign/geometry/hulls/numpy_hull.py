"""Convex hulls in NumPy: for bodies that the compiled kernels leave undecided, and for all bodies
where kernels were not built.

Qhull's triangles are merged where they are coplanar within a tolerance. At a tolerance of 0 the
hull is exact for the given floats (`exact_facets`).
"""

from __future__ import annotations

from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial import QhullError, cKDTree

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.meshes.body import consistent_winding
from dicedesign.geometry.predicates import Orientation
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors, edge_neighbors, find_parts
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import FLATNESS_TOLERANCE, ROUNDING


def hull_triangles(points: Floats) -> tuple[Integers, Integers]:
    """Triangles (t, 3) of the hull of points (n, 3), counter-clockwise seen from outside, and their
    neighbors (t, 3): `neighbors[t, k]` lies across the edge opposite to corner k.

    Raises scipy's QhullError where the points span no solid.
    """
    try:
        qhull = QhullHull(points)
    except QhullError:
        # Clusters of points make a facet wider than rounding explains. With Q12 Qhull continues
        # anyway; flat triangles are merged afterwards.
        qhull = QhullHull(points, qhull_options="Qt Q12 Pp")
    triangles = qhull.simplices.astype(np.int64)
    neighbors = qhull.neighbors.astype(np.int64)
    outward = (doubled_area_vectors(points, triangles) * qhull.equations[:, :3]).sum(-1)
    flip = outward < 0.0
    wound = consistent_winding(triangles)
    if wound is not None:
        # Normals of slivers are only rounding noise: all are turned like the clearest.
        clearest = np.argmax(np.abs(outward))
        turned = (wound != triangles).any(axis=1)
        flip = turned ^ turned[clearest] ^ flip[clearest]
    triangles[flip], neighbors[flip] = triangles[flip][:, [0, 2, 1]], neighbors[flip][:, [0, 2, 1]]
    return triangles, neighbors


def facet_labels(
    points: Floats, triangles: Integers, neighbors: Integers, tolerance: float
) -> Integers:
    """Facet number of each triangle: all corners of a facet lie within `tolerance` of the plane of
    its largest triangle.

    points: (n, 3); triangles: (t, 3) counter-clockwise seen from outside; neighbors: (t, 3) across
    the edge opposite to each corner; tolerance: a length. Returns (t,) integers from 0.
    """
    count = len(triangles)
    doubled = doubled_area_vectors(points, triangles)
    area = norms(doubled)
    normals = doubled / np.maximum(area, np.finfo(np.float64).tiny)[:, None]

    def fits(base: Integers, other: Integers) -> NDArray[np.bool_]:
        """Whether the corners of other triangles are near the planes of base triangles."""
        offset = points[triangles[other]] - points[triangles[base, 0]][:, None, :]
        heights = np.abs((offset * normals[base][:, None, :]).sum(-1))
        return heights.max(axis=1) <= tolerance

    def largest_of(labels: Integers) -> Integers:
        """The largest triangle of each label."""
        order = np.argsort(area, kind="stable")
        largest = np.empty(int(labels.max()) + 1, dtype=np.int64)
        largest[labels[order]] = order
        return largest

    left, right = np.repeat(np.arange(count), 3), neighbors.ravel()
    # Measured from the larger triangle of each pair: the normal of a sliver is mostly rounding.
    base = np.where(area[left] >= area[right], left, right)
    joined = fits(base, left + right - base)
    while True:
        labels = find_parts(left[joined], right[joined], count)
        # A chain of small bends is no facet: groups whose triangles drift from the plane of the
        # largest one are split into regions grown from the largest outward.
        drifts = ~fits(largest_of(labels)[labels], np.arange(count))
        for group in np.unique(labels[drifts]):
            members = np.flatnonzero(labels == group)
            labels[members] = -1
            for seed in members[np.argsort(-area[members], kind="stable")]:
                front = [seed] if labels[seed] == -1 else []
                labels[front] = labels.max() + 1
                while front:
                    beside = neighbors[front.pop()]
                    beside = beside[labels[beside] == -1]
                    beside = beside[fits(np.full(len(beside), seed), beside)]
                    labels[beside] = labels[seed]
                    front.extend(beside)
        labels = np.unique(labels, return_inverse=True)[1].astype(np.int64)
        # A sliver among slivers may fit the plane of a neighbor's group.
        largest = largest_of(labels)
        base = largest[labels[right]]
        missed = (labels[left] != labels[right]) & (area[largest[labels[left]]] < area[base])
        missed &= fits(base, left) & ~joined
        if not missed.any():
            return labels
        joined |= missed


HalfEdges = tuple[Integers, Integers, Integers, Integers]
"""`source`, `facet_start`, `tail` and `twin` of a `ConvexHull`."""


def facet_loops(
    points: int, triangles: Integers, neighbors: Integers, labels: Integers
) -> tuple[HalfEdges, Integers] | None:
    """Polygonal half-edge structure of labeled triangles with the facet (m,) of each label, or None
    where it is no polyhedron.

    points: their number; triangles: (t, 3) of a closed surface, counter-clockwise seen from
    outside; neighbors: (t, 3) across the edge opposite to each corner; labels: (t,) facet of
    each triangle, from 0. Corners at which only two facets meet are left out.
    """
    triangle, corner = np.nonzero(labels[:, None] != labels[neighbors])
    tails = triangles[triangle, (corner + 1) % 3]
    heads = triangles[triangle, (corner + 2) % 3]
    meeting = np.bincount(tails, minlength=points)
    ahead: list[dict[int, int]] = [{} for _ in range(int(labels.max()) + 1)]
    for facet, tail, head in np.stack([labels[triangle], tails, heads], axis=1).tolist():
        ahead[facet][tail] = head
    # A corner that a border passes twice has only one edge ahead of it.
    if sum(map(len, ahead)) < len(tails):
        return None
    labeled = []
    for label, border in enumerate(ahead):
        loop = list(border)[:1]
        while loop and border.get(loop[-1], loop[0]) != loop[0] and len(loop) < len(border):
            loop.append(border[loop[-1]])
        corners = [vertex for vertex in loop if meeting[vertex] >= 3]
        closed = loop and border.get(loop[-1]) == loop[0]
        if not closed or len(loop) < len(border) or len(corners) < 3:
            return None
        lowest = corners.index(min(corners))
        labeled.append((corners[lowest:] + corners[:lowest], label))
    labeled.sort()
    facet_of_label = np.argsort([label for _, label in labeled])
    loops = [loop for loop, _ in labeled]
    source, tail = np.unique(list(chain(*loops)), return_inverse=True)
    head = np.searchsorted(source, list(chain(*(loop[1:] + loop[:1] for loop in loops))))
    numbers = {edge: number for number, edge in enumerate(zip(tail, head, strict=True))}
    twin = np.array([numbers.get(edge, -1) for edge in zip(head, tail, strict=True)])
    if (twin < 0).any() or len(source) - len(tail) // 2 + len(loops) != 2:
        return None
    return (source, np.cumsum([0, *map(len, loops)]), tail, twin), facet_of_label


def merged_half_edges(
    positions: Floats, coplanar_tolerance: float, precision: float
) -> HalfEdges | None:
    """Half-edges of the hull of points with facets that are flat within a tolerance above 0, or
    None where these make no polyhedron. Points closer together than the tolerance are merged.

    positions: (n, 3); coplanar_tolerance: see `convex_hull`; precision: relative spacing of the
    coordinates. Raises DegenerateBodyError as `convex_hull`.
    """
    scaled, tolerance = _scale(positions, coplanar_tolerance, precision)
    used = np.arange(len(scaled))
    while True:
        try:
            triangles, neighbors = hull_triangles(scaled[used])
        except QhullError as error:
            raise flat_error(scaled) from error
        triangles = used[triangles]
        labels = facet_labels(scaled, triangles, neighbors, tolerance)
        found = facet_loops(len(scaled), triangles, neighbors, labels)
        if found is None:
            # Points that nearly coincide can leave facets that are cut apart.
            edges = triangles[:, [0, 1, 2, 1, 2, 0]].reshape(-1, 2)
        else:
            source, _, tails, twins = found[0]
            edges = source[np.column_stack([tails, tails[twins]])]
        repeated = _find_repeats(scaled, used, edges, tolerance)
        if len(repeated) == 0:
            return None if found is None else found[0]
        used = np.setdiff1d(used, repeated)


def _find_repeats(points: Floats, used: Integers, edges: Integers, distance: float) -> Integers:
    """Find points in use within a distance of a point of lower number, which stands for them.

    edges: (h, 2) both ways; only points with one that short are searched around.
    """
    tail, head = edges.T
    short = (norms(points[head] - points[tail]) <= distance) & (tail < head)
    if not short.any():
        return np.empty(0, dtype=np.int64)
    standing = np.setdiff1d(tail[short], head[short])
    close = cKDTree(points[used]).query_ball_point(points[standing], distance)
    return np.setdiff1d(used[np.concatenate(close).astype(np.int64)], standing)


def exact_half_edges(
    positions: Floats, coplanar_tolerance: float, precision: float
) -> tuple[HalfEdges, HalfEdges | None, Integers]:
    """Half-edges of the hull of points as they are; and of the hull with facets that are merged
    within a tolerance, with the merged facet (m,) of each facet, if any are and they make a
    polyhedron. See `merged_half_edges`; the tolerance may be 0."""
    scaled, tolerance = _scale(positions, coplanar_tolerance, precision)
    extents = np.abs(scaled).max(axis=0)
    facets = exact_facets(positions, scaled / np.where(extents > 0.0, extents, 1.0))
    found = None if facets is None else facet_loops(len(positions), *facets)
    if facets is None or found is None:
        raise flat_error(scaled)
    triangles, neighbors, flat = facets
    half_edges, facet_of_flat = found
    if coplanar_tolerance > 0.0:
        labels = facet_labels(scaled, triangles, neighbors, tolerance)
        merged = facet_loops(len(positions), triangles, neighbors, labels)
        if merged is not None and len(merged[1]) < len(facet_of_flat):
            facet = np.empty(len(facet_of_flat), dtype=np.int64)
            facet[facet_of_flat[flat]] = merged[1][labels]
            return half_edges, merged[0], facet
    return half_edges, None, np.arange(len(facet_of_flat))


def _scale(positions: Floats, coplanar_tolerance: float, precision: float) -> tuple[Floats, float]:
    """Points (n, 3) moved and scaled so that coordinates are at most 1, and the distance within
    which they are coplanar. Raises DegenerateBodyError as `convex_hull`."""
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
    magnitude = max(float(np.abs(lower).max()), float(np.abs(upper).max()))
    return local / scale, coplanar_tolerance + 4.0 * precision * magnitude / scale


def flat_error(local: Floats) -> DegenerateBodyError:
    """Error about points (n, 3) that span no solid, which says whether they span a plane."""
    extents = np.linalg.svd(local - local.mean(axis=0), compute_uv=False)
    rank = int((extents > FLATNESS_TOLERANCE * extents[0]).sum())
    where = {1: "on one line", 2: "on one plane"}.get(rank, "too close to one plane")
    return DegenerateBodyError(
        f"points: expected points that span a solid, got {len(local)} points {where}; "
        "a body needs thickness in all three directions"
    )


PLANE_ROUNDING = 16.0 * ROUNDING
"""Bound on the rounding error of the height of a point above a triangle, when coordinates are at
most 1 and rounded: relative to the longest side of the triangle, with heights multiplied by its
doubled area."""

BLOCK = 32
"""Points that are compared with all triangles at once: most are inside."""


def exact_facets(points: Floats, scaled: Floats) -> tuple[Integers, Integers, Integers] | None:
    """Convex hull as triangles, none of them degenerate, and the facet that each belongs to.

    From a triangle with two sides on, points are added by the incremental step, which only asks on
    which side of a triangle a point lies. A point in a triangle's plane counts as one that sees it:
    then the triangles that a point sees form a disc, and those put in their place are never
    degenerate. A point that sees no triangle from outside its plane is left out.

    points: (n, 3), finite; scaled: (n, 3) these points moved and scaled along the axes so that
    coordinates are at most 1, rounded.

    Returns triangles (t, 3), counter-clockwise seen from outside, their neighbors (t, 3) across
    the edge opposite to each corner, and facet numbers (t,) from 0; None where all points lie on
    one plane. Facets are exactly flat, and edges between two of them exactly convex.

    Source: Preparata and Shamos, Computational Geometry, 1985, section 3.4.
    """
    sides, count = Orientation(points), len(points)
    # Far points first: they leave the others inside.
    order = np.argsort(-norms(scaled), kind="stable")
    arms = scaled - scaled[order[0]]
    second = int(np.argmax(norms(arms)))
    by_area = np.argsort(-norms(np.linalg.cross(arms, arms[second])), kind="stable")
    third = next((p for p in by_area if not sides.collinear(order[0], second, p)), None)
    if third is None:
        return None
    base = np.array([order[0], second, third])
    above = np.flatnonzero(sides.signs(np.tile(base, (count, 1)), np.arange(count)))
    if len(above) == 0:
        return None
    heights = np.abs(arms[above] @ np.linalg.cross(arms[second], arms[third]))
    apex = above[[heights.argmax()]]
    triangles = np.array([base, base[::-1]])
    planes = _planes(scaled[triangles])

    def signs_of(points: Integers) -> Floats:
        """(k, t) 1, 0 or -1 for points (k,) above, on or below the plane of each triangle."""
        values = scaled[points] @ planes[:, :3].T + planes[:, 3]
        signs = np.sign(values)
        row, triangle = np.nonzero(np.abs(values) <= planes[:, 4])
        if len(row):
            signs[row, triangle] = sides.signs(triangles[triangle], points[row])
        return signs

    for block in (apex, *np.array_split(order, 1 + count // BLOCK)):
        for point in block[(signs_of(block) > 0).any(axis=1)]:
            signs = signs_of(point[None])[0]
            if signs.max() <= 0:
                continue
            visible = triangles[signs >= 0]
            tail, head = visible.ravel(), np.roll(visible, -1, axis=1).ravel()
            horizon = ~np.isin(tail * count + head, head * count + tail)
            fan = np.stack([tail[horizon], head[horizon], np.full(horizon.sum(), point)], axis=1)
            triangles = np.concatenate([triangles[signs < 0], fan])
            planes = np.concatenate([planes[signs < 0], _planes(scaled[fan])])
    neighbors = edge_neighbors(triangles)
    # The corner of the neighbor that is not on the common edge.
    beyond = triangles[neighbors].sum(axis=2) - (triangles.sum(axis=1)[:, None] - triangles)
    left, corner = np.nonzero(neighbors > np.arange(len(triangles))[:, None])
    flat = sides.signs(triangles[left], beyond[left, corner]) == 0
    labels = find_parts(left[flat], neighbors[left, corner][flat], len(triangles))
    return triangles, neighbors, labels


def _planes(corners: Floats) -> Floats:
    """(t, 5) normals of triangles (t, 3, 3), heights of the origin above them, and bounds on the
    rounding errors of heights above them."""
    a, b, c = corners.transpose(1, 0, 2)
    normals = np.linalg.cross(b - a, c - a)
    longest = np.maximum(np.abs(b - a), np.abs(c - a)).max(axis=1)
    bounds = PLANE_ROUNDING * longest + np.finfo(np.float64).tiny
    return np.column_stack([normals, -(normals * a).sum(-1), bounds])
