"""Convex hulls by Qhull, with the coplanar ones of its triangles merged in NumPy, and the errors
for points that span no solid.

This is the way for bodies about which the compiled kernels give up, for a coplanar tolerance of 0,
and for all bodies where kernels were not built.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import QhullError, cKDTree

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.coplanar import facet_labels
from dicedesign.geometry.hulls.exact_hull import exact_facets
from dicedesign.geometry.hulls.half_edges import HalfEdges, facet_loops
from dicedesign.geometry.hulls.qhull import hull_triangles
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import COPLANAR_WIDENINGS, FLATNESS_TOLERANCE

__all__ = ["flat_error", "hull_half_edges", "thickness"]


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
