"""The convex hull with polygonal facets, as half-edges.

Qhull gives triangles; coplanar ones are merged here, so that a cube has six facets. Half-edges are
stored facet by facet, counter-clockwise seen from outside, in an order that depends only on which
vertices each facet has.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import QhullError, cKDTree
from scipy.spatial.distance import cdist

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.body import as_numbers
from dicedesign.geometry.coplanar import facet_labels
from dicedesign.geometry.mass import solid_properties
from dicedesign.geometry.qhull import hull_triangles
from dicedesign.geometry.ragged import ragged_ranges
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.tolerances import (
    COPLANAR_TOLERANCE,
    COPLANAR_TOLERANCE_FLOAT32,
    COPLANAR_WIDENINGS,
    FLATNESS_TOLERANCE,
)

__all__ = ["ConvexHull", "convex_hull"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class ConvexHull:
    """A convex polyhedron with polygonal facets.

    Attributes
    ----------
    vertices: (n, 3) corners only; points inside facets or edges are left out.
    source: (n,) index of each corner in the points the hull was made from.
    facet_start: (m + 1,) half-edges of facet f are `facet_start[f] : facet_start[f + 1]`. The first
        one starts at the facet's lowest vertex, and facets are sorted by their first half-edges.
    tail: (h,) vertex where a half-edge starts.
    twin: (h,) the opposite half-edge, which lies in the neighbouring facet.
    """

    vertices: Floats
    source: Integers
    facet_start: Integers
    tail: Integers
    twin: Integers

    @cached_property
    def facet(self) -> Integers:
        """(h,) the facet to the left of each half-edge."""
        return np.repeat(np.arange(len(self.facet_start) - 1), np.diff(self.facet_start))

    @cached_property
    def next(self) -> Integers:
        """(h,) the following half-edge of the same facet."""
        following = np.arange(1, len(self.tail) + 1)
        following[self.facet_start[1:] - 1] = self.facet_start[:-1]
        return following

    @cached_property
    def previous(self) -> Integers:
        """(h,) the preceding half-edge of the same facet."""
        preceding = np.arange(-1, len(self.tail) - 1)
        preceding[self.facet_start[:-1]] = self.facet_start[1:] - 1
        return preceding

    @cached_property
    def head(self) -> Integers:
        """(h,) vertex where a half-edge ends."""
        return self.tail[self.next]

    @cached_property
    def outgoing(self) -> tuple[Integers, Integers]:
        """Half-edges by the vertex they leave: `(start (n + 1,), half_edges (h,))`."""
        order = np.argsort(self.tail, kind="stable")
        degree = np.bincount(self.tail, minlength=len(self.vertices))
        return np.concatenate([[0], np.cumsum(degree)]), order

    @cached_property
    def area_vectors(self) -> Floats:
        """(m, 3) outward normals of length twice the facet's area, in squared length units."""
        doubled = doubled_area_vectors(self.vertices, self.triangles)
        first = self.facet_start[:-1] - 2 * np.arange(len(self.facet_start) - 1)
        return np.add.reduceat(doubled, first, axis=0)

    @cached_property
    def normals(self) -> Floats:
        """(m, 3) outward unit normals."""
        return unit_vectors(self.area_vectors)

    @cached_property
    def areas(self) -> Floats:
        """(m,) facet areas."""
        return 0.5 * norms(self.area_vectors)

    @cached_property
    def triangles(self) -> Integers:
        """(t, 3) the facets as fans of triangles, counter-clockwise seen from outside."""
        first = self.facet_start[:-1][self.facet]
        inner = np.flatnonzero((self.next != first) & (np.arange(len(self.tail)) != first))
        return np.stack([self.tail[first[inner]], self.tail[inner], self.head[inner]], axis=1)

    @cached_property
    def centroid(self) -> Floats:
        """(3,) center of mass of the uniform solid hull."""
        return solid_properties(self.vertices, self.triangles)[1]

    def polygon(self, facet: int) -> Floats:
        """(k, 3) corners of a facet, counter-clockwise seen from outside."""
        return self.vertices[self.tail[self.facet_start[facet] : self.facet_start[facet + 1]]]

    @cached_property
    def diameter(self) -> float:
        """Largest vertex-to-vertex distance."""
        return max(float(cdist(x[None], self.vertices).max()) for x in self.vertices)


def convex_hull(
    points: ArrayLike, coplanar_tolerance: float | None = None, *, single_precision: bool = False
) -> ConvexHull:
    """Convex hull of points, with coplanar triangles merged into polygonal facets.

    Parameters
    ----------
    points: (n, 3) in any length unit.
    coplanar_tolerance: largest distance from a facet's plane, relative to half the extent of the
        points. Default: `COPLANAR_TOLERANCE`, or `COPLANAR_TOLERANCE_FLOAT32` for rounded points.
        Unless it is 0, the rounding of points far from the origin is added, points nearer than that
        to another are left out, and where the facets make no polyhedron it is widened in turn by
        `COPLANAR_WIDENINGS`.
    single_precision: the points were rounded to float32 before they came here; float32 arrays
        always count as such.

    Raises
    ------
    DegenerateBodyError: fewer than 4 points, NaN or infinity, all points on a plane or a line, or
        facets that cannot be told apart at this tolerance.
    InputError: the points are no (n, 3) array of real numbers, or the tolerance is not in [0, 1).
    """
    given = as_numbers(points, "points")
    single = single_precision or given.dtype == np.float32
    if coplanar_tolerance is None:
        coplanar_tolerance = COPLANAR_TOLERANCE_FLOAT32 if single else COPLANAR_TOLERANCE
    if not 0.0 <= coplanar_tolerance < 1.0:
        raise InputError(
            f"coplanar tolerance: expected a number in [0, 1), got {coplanar_tolerance:g}; "
            "leave it out for the default"
        )
    positions = given.astype(np.float64)
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
    local = positions - (lower + upper) / 2.0
    scale = float(np.abs(local).max())
    if scale == 0.0:
        raise DegenerateBodyError(
            "points: expected points that span a solid, got one repeated; pass distinct points"
        )
    magnitude = max(float(np.abs(lower).max()), float(np.abs(upper).max()))
    tolerance = coplanar_tolerance
    if coplanar_tolerance > 0.0:
        eps = float(np.finfo(np.float32 if single else np.float64).eps)
        tolerance += 4.0 * eps * magnitude / scale
    kept, scaled = np.arange(len(positions)), local / scale
    while True:
        try:
            hull = _merged_hull(positions, kept, scaled, tolerance)
        except QhullError as error:
            raise _flat_error(local) from error
        if hull is None:
            break
        repeated = _repeated(scaled, kept, hull, tolerance)
        if len(repeated) == 0:
            return hull
        kept = np.setdiff1d(kept, repeated)
    if _thickness(local) <= 2.0 * tolerance * scale:
        raise _flat_error(local)
    raise DegenerateBodyError(
        "points: expected facets that can be told apart, got none that make a polyhedron at a "
        f"coplanar tolerance of {coplanar_tolerance:g}; pass another coplanar_tolerance or remove "
        "points that nearly coincide"
    )


def _merged_hull(
    positions: Floats, kept: Integers, scaled: Floats, tolerance: float
) -> ConvexHull | None:
    """Hull of the kept points, or None where its facets make no polyhedron at any tolerance."""
    triangles, neighbors = hull_triangles(scaled[kept])
    triangles = kept[triangles]
    for factor in COPLANAR_WIDENINGS if tolerance > 0.0 else COPLANAR_WIDENINGS[:1]:
        labels = facet_labels(scaled, triangles, neighbors, factor * tolerance)
        hull = _half_edges(positions, triangles, neighbors, labels)
        if hull is not None:
            return hull
    return None


def _repeated(points: Floats, kept: Integers, hull: ConvexHull, distance: float) -> Integers:
    """Kept points within a distance of a vertex of lower number, which stands for them; only those
    are looked for that make an edge so short."""
    tail, head = hull.source[hull.tail], hull.source[hull.head]
    short = (norms(points[head] - points[tail]) <= distance) & (tail < head) & (distance > 0.0)
    if not short.any():
        return np.empty(0, dtype=np.int64)
    standing = np.setdiff1d(tail[short], head[short])
    close = cKDTree(points[kept]).query_ball_point(points[standing], distance)
    return np.setdiff1d(kept[np.concatenate(close).astype(np.int64)], standing)


def _thickness(local: Floats) -> float:
    """Extent of points (n, 3) across the plane that fits them best."""
    across = np.linalg.svd(local - local.mean(axis=0), full_matrices=False)[2][-1]
    return float(np.ptp(local @ across))


def _flat_error(local: Floats) -> DegenerateBodyError:
    extents = np.linalg.svd(local, compute_uv=False)
    rank = int((extents > FLATNESS_TOLERANCE * extents[0]).sum())
    where = {1: "on one line", 2: "on one plane"}.get(rank, "too close to one plane")
    return DegenerateBodyError(
        f"points: expected points that span a solid, got {len(local)} points {where}; "
        "a body needs thickness in all three directions"
    )


def _half_edges(
    points: Floats, triangles: Integers, neighbors: Integers, labels: Integers
) -> ConvexHull | None:
    """Polygonal half-edge structure of labelled triangles, or None where it is no polyhedron."""
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
    size = np.int64(len(points))
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
    keep = np.bincount(tail, minlength=len(points))[tail] >= 3
    tail, facet = tail[keep], facet[keep]
    count = np.bincount(facet, minlength=facets)
    if (count < 3).any():
        return None
    facet_start = np.concatenate([[0], np.cumsum(count)])
    source, tail = np.unique(tail, return_inverse=True)
    facet_start, tail = _sorted_facets(facet_start, tail)
    bare = ConvexHull(points[source], source, facet_start, tail, np.empty(0, dtype=np.int64))
    size = np.int64(len(source))
    forward, backward = bare.tail * size + bare.head, bare.head * size + bare.tail
    order = np.argsort(forward)
    found = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    twin = order[found]
    if (forward[twin] != backward).any() or len(source) - len(tail) // 2 + facets != 2:
        return None
    return ConvexHull(bare.vertices, source, facet_start, tail, twin)


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
