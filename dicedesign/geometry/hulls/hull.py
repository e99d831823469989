"""The convex hull with polygonal facets, as half-edges.

Coplanar triangles are merged, so that a cube has six facets. The compiled kernel makes a hull where
its result is certain, `numpy_hull` elsewhere. Half-edges are stored facet by facet,
counter-clockwise seen from outside, in an order that depends only on which vertices each facet has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import as_numbers
from dicedesign.geometry.predicates import IntegerPoints
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, solid_properties
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import (
    COPLANAR_TOLERANCE,
    COPLANAR_TOLERANCE_FLOAT32,
    ROUNDING,
    SLIVER,
    WARP_TOLERANCE,
)

CONNECTIVITY = frozenset(
    ["facet_start", "tail", "twin", "facet", "next", "previous", "head", "outgoing", "triangles"]
)
"""Fields and cached properties of a hull that do not depend on where its vertices are."""

MOST_INSIDE = 64
"""Most points inside a hull for which its connectivity is checked: more would take longer than a
new hull."""

AT_A_TIME = 128
"""Points that are compared with all facets at once."""

FLOAT32_EPS = float(np.finfo(np.float32).eps)

FLOAT64_EPS = float(np.finfo(np.float64).eps)


class FinerHull(NamedTuple):
    """The hull of points as they are, beside one with merged facets.

    Attributes
    ----------
    hull: its facets are exactly flat.
    facet: (m,) the merged facet that each of its facets belongs to.
    """

    hull: ConvexHull
    facet: Integers


@dataclass(frozen=True)
class ConvexHull(kernels.Handled):
    """A convex polyhedron with polygonal facets.

    Attributes
    ----------
    vertices: (n, 3) corners only; points inside facets or edges are left out.
    source: (n,) index of each corner in the given points.
    facet_start: (m + 1,) half-edges of facet f are `facet_start[f] : facet_start[f + 1]`. The first
        one starts at the facet's lowest vertex, and facets are sorted by their first half-edges.
    tail: (h,) vertex where a half-edge starts.
    twin: (h,) the opposite half-edge, which lies in the neighboring facet.
    finer: the hull of the points as they are, where facets of this one are flat only within a
        tolerance that rounding may have bent them by (`convex_hull`); rests are those of that hull.
    """

    vertices: Floats
    source: Integers
    facet_start: Integers
    tail: Integers
    twin: Integers
    finer: FinerHull | None = None

    @classmethod
    def with_attributes(cls, attributes: dict[str, Any]) -> ConvexHull:
        """Hull from all its attributes and some cached properties by name, in less time than
        `ConvexHull(...)` takes."""
        hull = object.__new__(cls)
        hull.__dict__.update(attributes)
        return hull

    @cached_property
    def handle(self) -> Any:
        """C++ handle of this hull for kernels."""
        polygons = self.vertices, self.facet_start, self.tail, self.twin
        ways = self.head, self.facet, self.next, self.previous, *self.outgoing
        return kernels.new_handle("Hull", *polygons, *ways, self.normals, self.areas)

    @cached_property
    def facet(self) -> Integers:
        """(h,) the facet to the left of each half-edge."""
        return np.repeat(np.arange(len(self.facet_start) - 1), np.diff(self.facet_start))

    @cached_property
    def next(self) -> Integers:
        """(h,) the next half-edge in its facet."""
        following = np.arange(1, len(self.tail) + 1)
        following[self.facet_start[1:] - 1] = self.facet_start[:-1]
        return following

    @cached_property
    def previous(self) -> Integers:
        """(h,) the previous half-edge in its facet."""
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
    def _exponent(self) -> int:
        """Binary exponent of the largest coordinate."""
        return int(np.frexp(np.abs(self.vertices).max())[1])

    @cached_property
    def _unit_vertices(self) -> Floats:
        """(n, 3) vertices times a power of two that makes the largest coordinate about 1, so that
        their products are floats for a body of any size."""
        return np.ldexp(self.vertices, -self._exponent)

    @cached_property
    def _unit_area_vectors(self) -> Floats:
        """(m, 3) outward normals of length twice the area of the facet between `_unit_vertices`."""
        points = self._unit_vertices
        doubled = doubled_area_vectors(points, self.triangles)
        first = self.facet_start[:-1] - 2 * np.arange(len(self.facet_start) - 1)
        vectors = np.add.reduceat(doubled, first, axis=0)
        extents = np.ptp(points, axis=0)
        exact = IntegerPoints(points)
        for facet in np.flatnonzero(norms(vectors) <= SLIVER * (extents @ extents)):
            corners = self.tail[self.facet_start[facet] : self.facet_start[facet + 1]]
            longest = norms(points[corners] - points[np.roll(corners, 1)]).max()
            if norms(vectors[facet]) <= SLIVER * longest * longest:
                vectors[facet] = exact.area_vector(corners)
        return vectors

    @cached_property
    def normals(self) -> Floats:
        """(m, 3) outward unit normals."""
        return unit_vectors(self._unit_area_vectors)

    @cached_property
    def areas(self) -> Floats:
        """(m,) facet areas, in squared length units; 0 or infinite where they underflow or
        overflow."""
        with np.errstate(over="ignore", under="ignore"):
            return np.ldexp(0.5 * norms(self._unit_area_vectors), 2 * self._exponent)

    @cached_property
    def unevenness(self) -> float:
        """Largest distance of two corners of one facet across its plane; 0 to within rounding where
        all facets are flat."""
        return float(self._unevenness.max())

    @cached_property
    def _unevenness(self) -> Floats:
        """(m,) unevenness of each facet."""
        start = self.facet_start[:-1]
        points = self._unit_vertices
        offsets = points[self.tail] - points[self.tail[start]][self.facet]
        heights = (offsets * self.normals[self.facet]).sum(-1)
        spans = np.maximum.reduceat(heights, start) - np.minimum.reduceat(heights, start)
        return np.ldexp(spans, self._exponent)

    @cached_property
    def warp(self) -> float:
        """Largest sine of the angle between an edge and the line in which the planes of its two
        facets meet, 1 where they meet the wrong way round. 0 where all facets are flat to within
        rounding."""
        extent = float(np.ptp(self.vertices, axis=0).max())
        rough = self._unevenness > ROUNDING * extent
        edges = np.flatnonzero(rough[self.facet] | rough[self.facet[self.twin]])
        if len(edges) == 0:
            return 0.0
        along = self._unit_vertices[self.head[edges]] - self._unit_vertices[self.tail[edges]]
        left, right = self.facet[edges], self.facet[self.twin[edges]]
        line = np.linalg.cross(self.normals[left], self.normals[right])
        size = norms(line) * norms(along)
        sine = norms(np.linalg.cross(line, along)) / np.where(size > 0.0, size, 1.0)
        return float(np.where((line * along).sum(-1) > 0.0, sine, 1.0).max())

    @cached_property
    def triangles(self) -> Integers:
        """(t, 3) the facets as fans of triangles, counter-clockwise seen from outside."""
        first = self.facet_start[:-1][self.facet]
        inner = np.flatnonzero((self.next != first) & (np.arange(len(self.tail)) != first))
        return np.stack([self.tail[first[inner]], self.tail[inner], self.head[inner]], axis=1)

    @property
    def surface(self) -> Surface:
        """Surface of the hull."""
        return Surface(self.vertices, self.triangles)

    @cached_property
    def centroid(self) -> Floats:
        """(3,) center of mass of the uniform solid hull. Raises DegenerateBodyError where rounding
        leaves no volume."""
        centroid = solid_properties(self._unit_vertices, self.triangles)[1]
        if not np.isfinite(centroid).all():
            raise DegenerateBodyError(
                "points: expected points that span a solid, got a hull whose volume is lost to "
                "rounding; a body needs thickness in all three directions"
            )
        return np.ldexp(centroid, self._exponent)

    def heights(self, point: Floats) -> Floats:
        """(m,) distances of the facets' planes from a point (3,), positive where it is inside."""
        corners = self.vertices[self.tail[self.facet_start[:-1]]]
        return ((corners - point) * self.normals).sum(-1)

    def depths(self, points: Floats) -> Floats:
        """(n, m) how far points (n, 3) are below the planes of the facets, negative above."""
        depths: Floats = self.heights(np.zeros(3)) - points @ self.normals.T
        return depths

    def least_depths(self, points: Floats) -> Floats:
        """(n,) how far points (n, 3) are below the nearest plane of a facet, negative outside."""
        # In parts that stay in the processor's memory: rounded dice have thousands of facets.
        parts = np.array_split(points, len(points) // AT_A_TIME + 1)
        return np.concatenate([self.depths(part).min(axis=1) for part in parts])

    def foot_depths(self, point: Floats) -> Floats:
        """(m,) distances of the foot of a point (3,) on the plane of each facet from the line of
        the nearest edge: positive where the foot is inside the facet, that is for stable ones."""
        edges = self.vertices[self.head] - self.vertices[self.tail]
        outward = np.linalg.cross(edges, self.normals[self.facet])
        distances = ((self.vertices[self.tail] - point) * outward).sum(-1) / norms(outward)
        depths: Floats = np.minimum.reduceat(distances, self.facet_start[:-1])
        return depths

    def polygon(self, facet: int) -> Floats:
        """(k, 3) corners of a facet, counter-clockwise seen from outside."""
        return self.vertices[self.tail[self.facet_start[facet] : self.facet_start[facet + 1]]]

    @cached_property
    def diameter(self) -> float:
        """Largest vertex-to-vertex distance; infinite where it overflows."""
        points = self._unit_vertices
        longest = max(float(norms(points - x).max()) for x in points)
        with np.errstate(over="ignore"):
            return float(np.ldexp(longest, self._exponent))


def hull_precision(single: bool) -> tuple[float, float]:
    """Default coplanar tolerance and relative spacing of coordinates in single or double
    precision."""
    if single:
        return COPLANAR_TOLERANCE_FLOAT32, FLOAT32_EPS
    return COPLANAR_TOLERANCE, FLOAT64_EPS


def convex_hull(
    points: ArrayLike, coplanar_tolerance: float | None = None, *, single_precision: bool = False
) -> ConvexHull:
    """Convex hull of points, with coplanar triangles merged into polygonal facets.

    Rounding bends facets. Those of rounded points are merged only to be shown: how the body rests
    is decided by the hull of the points as they are, which is `ConvexHull.finer`. The same holds
    for other points whose merged facets do not meet in lines (`WARP_TOLERANCE`). Where merged
    facets make no polyhedron, none are merged.

    Parameters
    ----------
    points: (n, 3) in any length unit.
    coplanar_tolerance: largest distance from a facet's plane, relative to half the extent of the
        points; the rounding of points far from the origin is added, and points that are not rounded
        and closer together than that are merged. Default: `COPLANAR_TOLERANCE`,
        or `COPLANAR_TOLERANCE_FLOAT32` for rounded points. At 0 nothing is merged: facets are
        exactly flat and edges exactly convex. Rounded points with a tolerance that is given count
        as others.
    single_precision: whether the points were rounded to float32; float32 arrays always count as
        such.

    Raises
    ------
    DegenerateBodyError: fewer than 4 points, NaN or infinity, or all points on a plane or a line.
    InputError: the points are no (n, 3) array of real numbers, or the tolerance is not in [0, 1).
    """
    given = as_numbers(points, "points")
    single = single_precision or given.dtype == np.float32
    usual, eps = hull_precision(single)
    is_rounded = single and coplanar_tolerance is None
    if coplanar_tolerance is None:
        coplanar_tolerance = usual
    if not (isinstance(coplanar_tolerance, Real) and 0.0 <= coplanar_tolerance < 1.0):
        raise InputError(
            f"coplanar tolerance: expected a number in [0, 1), got {coplanar_tolerance!r}; "
            "leave it out for the default"
        )
    tolerance = float(coplanar_tolerance)
    merged = None if is_rounded or tolerance == 0.0 else _merged_hull(given, tolerance, eps)
    if merged is not None:
        return merged if merged.warp <= WARP_TOLERANCE else _with_finer(merged, given)
    hulls = kernels.exact_hull(given, tolerance, eps)
    if hulls is not kernels.UNDECIDED:
        fields, coarser, facet = hulls
        hull = ConvexHull.with_attributes(fields)
        return hull if coarser is None else _pair(ConvexHull.with_attributes(coarser), hull, facet)
    # Imported late: it imports SciPy, which takes longer than a hull.
    from dicedesign.geometry.hulls.numpy_hull import exact_half_edges

    positions = given.astype(np.float64)
    half_edges, merged_edges, facet = exact_half_edges(positions, tolerance, eps)
    hull = _of_half_edges(positions, half_edges)
    if merged_edges is None:
        return hull
    return _pair(_of_half_edges(positions, merged_edges), hull, facet)


def _merged_hull(given: NDArray[Any], tolerance: float, eps: float) -> ConvexHull | None:
    """Hull of points with merged facets, or None where they make no polyhedron."""
    fields = kernels.convex_hull(given, tolerance, eps)
    if fields is not kernels.UNDECIDED:
        return ConvexHull.with_attributes(fields)
    from dicedesign.geometry.hulls.numpy_hull import merged_half_edges

    positions = given.astype(np.float64)
    half_edges = merged_half_edges(positions, tolerance, eps)
    return None if half_edges is None else _of_half_edges(positions, half_edges)


def _with_finer(hull: ConvexHull, points: NDArray[Any]) -> ConvexHull:
    """A hull with merged facets, and the one of the points as they are, whose facets belong to
    those with the nearest planes."""
    from scipy.spatial import cKDTree

    finer = convex_hull(points, 0.0)
    size = float(np.ptp(hull.vertices, axis=0).max())
    planes = [
        np.column_stack([each.normals, each.heights(finer.centroid) / size])
        for each in (hull, finer)
    ]
    return _pair(hull, finer, cKDTree(planes[0]).query(planes[1])[1])


def _pair(hull: ConvexHull, finer: ConvexHull, facet: Integers) -> ConvexHull:
    """A hull with merged facets that knows the finer one, and has its centroid."""
    hull.__dict__.update(finer=FinerHull(finer, facet), centroid=finer.centroid)
    return hull


def _of_half_edges(positions: Floats, half_edges: tuple[Integers, ...]) -> ConvexHull:
    source, facet_start, tail, twin = half_edges
    hull = ConvexHull(positions[source], source, facet_start, tail, twin)
    hull.__dict__.update(kernels.hull_properties(hull.vertices, facet_start, tail, twin) or {})
    return hull


HullMaker = Callable[[Floats], ConvexHull]
"""Function that makes the hull of points: `convex_hull` or `HullMemory.hull`."""


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
        """Hull of points (n, 3) float64, equal bit for bit to `convex_hull(points)`, with its
        errors."""
        hull = None if self._last is None else same_connectivity(self._last, points)
        if hull is None:
            hull = convex_hull(points)
            self.built += 1
        else:
            self.reused += 1
        self._last = hull
        return hull


def same_connectivity(hull: ConvexHull, points: Floats) -> ConvexHull | None:
    """Hull of moved points with the facets of a given hull, if it certainly has them: a check is
    cheaper than a new hull.

    The surface with those facets is checked edge by edge: facets are flat with convex corners, all
    edges bend inward, and the mean of the vertices sees the surface once in every direction. Such a
    surface bounds a convex body. All of this holds with enough margin (the `REUSE_...` tolerances)
    that neither rounding nor the coplanar tolerance lets `convex_hull` find another one. Only
    kernels do this.

    Parameters
    ----------
    hull: the hull before its points moved.
    points: (n, 3) float64, in the order of the hull's original points, or one for each of its
        vertices.

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
    moved = kernels.move_hull(points, source, hull.facet_start, hull.tail, hull.twin)
    if moved is kernels.UNDECIDED:
        return None
    connectivity = {name: value for name, value in vars(hull).items() if name in CONNECTIVITY}
    return ConvexHull.with_attributes({**connectivity, "source": source, **moved})


def polyhedron_corners(normals: ArrayLike, offsets: ArrayLike) -> NDArray[np.float64]:
    """Corners of the intersection of half-spaces `normals[i] . x <= offsets[i]`.

    By polarity: corner = plane of a facet of the convex hull of the points n_i / d_i.

    Parameters
    ----------
    normals: (m, 3), m >= 4, not necessarily unit.
    offsets: (m,) positive, so that the origin is strictly inside.

    Raises
    ------
    InputError: the shapes do not agree, or a number is missing or not finite.
    DegenerateBodyError: the intersection is unbounded or the origin is not strictly inside.

    Returns (n, 3).
    """
    n = as_numbers(normals, "half-spaces", "normals").astype(np.float64)
    try:
        d = np.asarray(offsets, dtype=np.float64)
    except (ValueError, TypeError):
        d = np.full(len(n), np.nan)
    if d.shape != (len(n),) or not np.isfinite(d).all():
        got = repr(offsets) if d.shape == (len(n),) else f"shape {d.shape}"
        raise InputError(
            f"half-spaces: expected {len(n)} finite offsets, got {got}; pass one for each normal"
        )
    if not np.isfinite(n).all():
        row = int(np.argmin(np.isfinite(n).all(axis=1)))
        raise InputError(
            f"half-spaces: expected finite normals, got {n[row].tolist()} in row {row}; repair it"
        )
    got = f"offset {d.min():g}"
    if (d > 0.0).all():
        polar = convex_hull(n / d[:, None])
        heights = polar.heights(np.zeros(3))
        if (heights > 0.0).all():
            return polar.normals / heights[:, None]
        got = "one that is unbounded"
    raise DegenerateBodyError(
        "half-spaces: expected an intersection that is bounded and has the origin inside, got "
        f"{got}; spread the normals over the whole sphere and keep the offsets positive"
    )


def deepest_point(normals: Floats, offsets: Floats) -> tuple[Floats, float]:
    """Point (3,) whose least distance from the planes `normals[i] . x = offsets[i]` is largest, and
    that distance: not above 0 where no point is inside of all planes, infinite where it is
    unbounded. Where it is unbounded or the linear program fails, the point is the origin.

    normals: (m, 3) unit; offsets: (m,), from a point that is not far from them.
    """
    # Imported late: rarely needed, and slow to load.
    from scipy.optimize import linprog

    size = float(np.abs(offsets).max())
    rows = np.column_stack([normals, np.ones(len(offsets))])
    bounds = [(None, None)] * 4
    solution = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=offsets / size, bounds=bounds)
    if solution.x is None or solution.status == 3:
        return np.zeros(3), np.inf if solution.status == 3 else -np.inf
    return size * solution.x[:3], size * float(solution.x[3])
