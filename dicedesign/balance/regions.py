"""Regions of centers of mass as half-spaces, and the half-spaces that determine the rests of a
body.

A body rests on a facet if its center of mass is above it: on the inner side of the plane through
each edge that is perpendicular to the facet. Probabilities jump where the center of mass crosses
such a plane.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import nnls
from scipy.stats import qmc

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import (
    ConvexHull,
    convex_hull,
    deepest_point,
    polyhedron_corners,
)
from dicedesign.geometry.sphere import even_directions, norms, unit_vectors
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers


@dataclass(frozen=True, eq=False)
class Halfspaces:
    """All points x with `normals @ x <= offsets`.

    Attributes
    ----------
    normals: (m, 3) unit; offsets: (m,).
    """

    normals: Floats
    offsets: Floats

    @classmethod
    def of_hull(cls, hull: ConvexHull) -> Halfspaces:
        """Half-spaces of a hull's facets."""
        return cls(hull.normals, hull.heights(np.zeros(3)))

    def heights(self, point: Floats) -> Floats:
        """(m,) signed distances of the planes from a point (3,), negative outside."""
        return self.offsets - self.normals @ point

    def and_within(self, other: Halfspaces) -> Halfspaces:
        """Intersection of two regions."""
        return Halfspaces(
            np.concatenate([self.normals, other.normals]),
            np.concatenate([self.offsets, other.offsets]),
        )

    @cached_property
    def deepest(self) -> tuple[Floats, float]:
        """Point (3,) with the largest least distance from the planes, and that distance: at most 0
        for an empty region, infinite for an unbounded one."""
        middle = self.normals.T @ self.offsets / len(self.offsets)
        move, depth = deepest_point(self.normals, self.heights(middle))
        return middle + move, depth

    def corners(self) -> ConvexHull | None:
        """Polyhedron of a bounded region; None if it is empty."""
        middle, depth = self.deepest
        if not 0.0 < depth < np.inf:
            return None
        try:
            return convex_hull(middle + polyhedron_corners(self.normals, self.heights(middle)))
        except DegenerateBodyError:
            return None


def points_within(hull: ConvexHull, count: int) -> Floats:
    """(count, 3) deterministic points that fill a hull evenly."""
    middle = hull.centroid
    corners = hull.vertices[hull.triangles] - middle
    draws = qmc.Halton(4, scramble=False).random(count + 1)[1:]
    which, weights = spread_evenly(np.abs(np.linalg.det(corners)), draws)
    return np.asarray(middle + (weights[:, :3, None] * corners[which]).sum(axis=1))


def spread_evenly(sizes: Floats, draws: Floats) -> tuple[Integers, Floats]:
    """Simplices (n,), and weights of their corners (n, k), of points spread evenly over simplices
    of sizes (m,); draws: (n, k) in [0, 1)."""
    shares = np.cumsum(sizes) / sizes.sum()
    which = np.searchsorted(shares, draws[:, 0]).clip(max=len(sizes) - 1)
    # Differences of sorted numbers are uniform weights.
    steps = np.sort(draws[:, 1:], axis=1)
    return which, np.diff(steps, axis=1, prepend=0.0, append=1.0)


UNSHIFTED = 1e-6
"""Least shift of the center of mass relative to the diagonal; less is lost in the single precision
of a file."""

REGULAR = 1e-9
"""Regularization of the quadratic form, relative to its trace."""


def least_within(form: Floats, slope: Floats, normals: Floats, heights: Floats) -> Floats:
    """(3,) minimizer x of `x . form x / 2 + slope . x` subject to `normals @ x <= heights`.

    form: (3, 3) symmetric, positive semidefinite; slope: (3,); normals: (m, 3); heights: (m,). The
    region must not be empty.

    Source: Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance
    programming by nonnegative least squares).
    """
    root = np.linalg.cholesky(form + REGULAR * np.trace(form) * np.eye(3))
    # In y = root^T x + offset, minimize the distance from the origin.
    offset = np.linalg.solve(root, slope)
    rows = -np.linalg.solve(root, normals.T)
    bounds = offset @ rows - heights
    system, wanted = np.vstack([rows, bounds]), np.eye(4)[3]
    rest = system @ nnls(system, wanted)[0] - wanted
    return np.asarray(np.linalg.solve(root.T, -rest[:3] / rest[3] - offset))


@dataclass(frozen=True, eq=False)
class Stability:
    """Prisms above the facets of a hull, in which a center of mass makes the facet a rest."""

    hull: ConvexHull

    @cached_property
    def sides(self) -> Halfspaces:
        """Plane of each half-edge, with its normal pointing out of the prism."""
        hull = self.hull
        tails = hull.vertices[hull.tail]
        edges = hull.vertices[hull.head] - tails
        normals = unit_vectors(np.linalg.cross(edges, hull.normals[hull.facet]))
        return Halfspaces(normals, (tails * normals).sum(axis=1))

    def outermost(self, center: Floats) -> tuple[Integers, Floats]:
        """(m,) half-edge of each facet with the smallest signed distance of its side from a center
        of mass (3,), and (m,) that distance, negative if the facet is no rest."""
        heights = self.sides.heights(center)
        start = self.hull.facet_start[:-1]
        least = np.minimum.reduceat(heights, start)
        # The first half-edge of each facet with that distance.
        lowest = np.flatnonzero(heights == least[self.hull.facet])
        _, first = np.unique(self.hull.facet[lowest], return_index=True)
        return lowest[first], least

    def count(self, center: Floats) -> int:
        """Number of rests with a center of mass (3,)."""
        return int((self.outermost(center)[1] > 0.0).sum())

    def clearance(self, center: Floats) -> float:
        """Upper bound of the distance from a center of mass (3,) to where a rest appears or
        vanishes."""
        return float(np.abs(self.outermost(center)[1]).min())

    def cell(self, center: Floats, clearance: float = 0.0) -> Halfspaces:
        """Convex region of centers of mass around one (3,) that have its rests. Planes are moved
        inward by a clearance."""
        inner = (self.outermost(center)[1] > 0.0)[self.hull.facet]
        inside = Halfspaces(self.sides.normals[inner], self.sides.offsets[inner] - clearance)
        return inside.and_within(self.without_new_rests(center, clearance))

    def without_new_rests(self, center: Floats, clearance: float = 0.0) -> Halfspaces:
        """Convex region of centers of mass without other rests than one (3,) has: beyond the
        farthest side of each facet that is no rest, by a clearance."""
        edges, least = self.outermost(center)
        return self.beyond(edges[least <= 0.0], clearance)

    def beyond(self, edges: Integers, clearance: float = 0.0) -> Halfspaces:
        """Region of centers of mass beyond the sides of half-edges, by a clearance."""
        return Halfspaces(-self.sides.normals[edges], -self.sides.offsets[edges] - clearance)


LEAST_DEPTH = 1e-7
"""Least distance of a center of mass beyond a side, relative to the diameter of the hull. Rounding
a file to single precision moves the center by about as much."""

DEEPER = 1.1
"""Factor by which a center of mass must be farther beyond sides to replace another."""

MAX_DISTANCES = 200_000_000
"""Number of distances of corners from sides at which a search stops, after some seconds."""

MAX_FIRST_DISTANCES = 20_000_000
"""Number of distances of a whole region above which a polyhedron inside of it is searched."""


def fewest_rests(stability: Stability, within: Halfspaces) -> tuple[Floats, int]:
    """Center of mass with fewest rests in a bounded region, and a lower bound of their number,
    which is that number unless the search stopped at `MAX_DISTANCES`.

    A facet is no rest if the center is beyond one of its sides by `LEAST_DEPTH`. Among centers with
    equally few rests, one far beyond such sides is chosen.

    Raises InputError for an empty region.
    """
    facets, depth = len(stability.hull.normals), LEAST_DEPTH * stability.hull.diameter
    center, bound = _divide(stability, within, depth, range(1, facets + 1))
    if center is None:
        raise InputError(
            "region: expected a center of mass within the hull, got none; enlarge the region"
        )
    while True:
        center = steadiest(stability, within, center)
        room = within.and_within(stability.without_new_rests(center))
        count, depth = stability.count(center), DEEPER * float(room.heights(center).min())
        deeper, _ = _divide(stability, within, depth, range(count, count + 1))
        if deeper is None:
            return center, min(bound, count)
        center = deeper


def _divide(
    stability: Stability, within: Halfspaces, depth: float, counts: range
) -> tuple[Floats | None, int]:
    """Center of mass with fewest rests and a lower bound of their number, by branch and bound: the
    region is divided along sides.

    depth: least distance of the center from the planes of the region, and beyond a side of each
    facet that is no rest. counts: the search stops at the first number, and finds none, None, above
    the last.
    """
    region = Halfspaces(within.normals, within.offsets - depth).corners()
    if region is None:
        return None, 1
    sides, facet, facets = stability.sides, stability.hull.facet, len(stability.hull.normals)
    max_corners = MAX_FIRST_DISTANCES // len(facet)
    is_whole = len(region.vertices) <= max_corners
    if not is_whole:
        extremes = np.argmax(region.vertices @ even_directions(max_corners).T, axis=0)
        region = convex_hull(region.vertices[np.unique(extremes)])
    best, most, distances = None, counts[-1], 0
    # Twice the certain rests and the other rests at the middle, the least first; minus a serial
    # number; certain rests; half-edge to cut along; corners, whether each is on each plane, and
    # undecided half-edges.
    parts: list[tuple[int, int, int, int, Floats, Booleans, Integers]] = []

    def of_facets(edges: Integers) -> Integers:
        return np.bincount(facet[edges], minlength=facets)

    def add(certain: int, corners: Floats, planes: Booleans, edges: Integers) -> None:
        nonlocal best, most, distances
        distances += len(corners) * len(edges)
        heights = sides.offsets[edges] - corners @ sides.normals[edges].T
        lowest, highest = heights.min(axis=0), heights.max(axis=0)
        # A part that was cut along a side ends there to within rounding.
        is_open = lowest < -1.01 * depth
        choices = of_facets(edges[is_open])
        certain += int(((of_facets(edges) > 0) & (choices == 0)).sum())
        undecided = (choices > 0) & (of_facets(edges[highest < -0.99 * depth]) == 0)
        is_rest = undecided & (of_facets(edges[heights.mean(axis=0) < -depth]) == 0)
        count = certain + int(is_rest.sum())
        if count <= most:
            best, most = corners.mean(axis=0), count - 1
        left = np.flatnonzero(is_open & undecided[facet[edges]])
        if len(left) > 0 and certain <= most:
            evenness = np.minimum(highest, -lowest)[left]
            edges = edges[left]
            cut = int(edges[np.lexsort((-evenness, choices[facet[edges]]))[0]])
            entry = certain + count, -distances, certain, cut, corners, planes, edges
            heapq.heappush(parts, entry)

    planes = np.zeros((len(region.vertices), len(region.normals)), bool)
    planes[region.tail, region.facet] = True
    add(0, region.vertices, planes, np.arange(len(facet)))
    while parts and most >= counts[0] and distances < MAX_DISTANCES:
        _, _, certain, cut, corners, planes, edges = heapq.heappop(parts)
        if certain > most:
            continue
        heights = sides.offsets[cut] - corners @ sides.normals[cut] + depth
        halves = np.flatnonzero(heights < 0.0), np.flatnonzero(heights >= 0.0)
        # Two corners on two common planes are the ends of an edge.
        common = planes[halves[0]].astype(np.float32) @ planes[halves[1]].T
        below, above = (half[k] for half, k in zip(halves, np.nonzero(common > 1.0), strict=True))
        part = (heights[below] / (heights[below] - heights[above]))[:, None]
        new = corners[below] + part * (corners[above] - corners[below])
        on_new = np.column_stack([planes[below] & planes[above], np.ones(len(new), bool)])
        for half in halves:
            on_half = np.vstack([np.pad(planes[half], ((0, 0), (0, 1))), on_new])
            half_corners = np.vstack([corners[half], new])
            add(certain, half_corners, on_half[:, on_half.any(axis=0)], edges)
    bound = min([most + 1, *(entry[2] for entry in parts)])
    return best, max(bound, 1) if is_whole else 1


def steadiest(stability: Stability, within: Halfspaces, center: Floats) -> Floats:
    """Center of mass farthest from where a rest appears, among those without other rests than a
    center (3,) has."""
    room = within.and_within(stability.without_new_rests(center))
    place = room.deepest[0]
    is_deeper = room.heights(place).min() > room.heights(center).min()
    return place if is_deeper and stability.count(place) <= stability.count(center) else center


INSIDE = 0.95
"""Scale of a hull, about its centroid, in which a center of mass may be: not next to the
surface."""


def whole_hull(hull: ConvexHull) -> ConvexHull:
    """Hull without the region next to its surface."""
    middle = hull.centroid
    return convex_hull(middle + INSIDE * (hull.vertices - middle))


def is_shifted(surface: Surface, center_of_mass: Floats) -> bool:
    """Whether a center of mass (3,) differs from the uniform solid's."""
    shift = float(norms(center_of_mass - surface.centroid))
    return shift > UNSHIFTED * surface.diagonal
