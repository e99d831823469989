"""Regions of centers of mass as half-spaces, and the half-spaces that determine the rests of a
body.

A body rests on a facet if its center of mass is above it: on the inner side of the plane through
each edge that is perpendicular to the facet. Probabilities jump where the center of mass crosses
such a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import nnls
from scipy.stats import qmc

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import (
    ConvexHull,
    convex_hull,
    deepest_point,
    polyhedron_corners,
)
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers


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


LEAST_DEPTH = 1e-9
"""Least distance of a center of mass beyond a side, relative to the diameter of the hull."""


def fewest_rests(stability: Stability, within: Halfspaces, centers: Floats, steps: int) -> Floats:
    """Center of mass with fewest rests in a greedy search from starts (n, 3).

    From each start, one resting facet after the other is made unstable: the center of mass moves
    beyond one of its sides, and stays beyond a side of each facet that is no rest. A linear program
    for each side, nearest sides first, finds the center farthest beyond. The result need not be the
    global minimum.

    within: region of the center of mass; steps: largest number of facets for each start.
    """
    best, fewest = centers[0], len(stability.hull.normals) + 1
    for center in centers:
        for _ in range(steps):
            following = _one_less(stability, within, center)
            if following is None:
                break
            center = following
        count = stability.count(center)
        if count < fewest:
            best, fewest = center, count
        if fewest == 1:
            break
    return steadiest(stability, within, best)


def steadiest(stability: Stability, within: Halfspaces, center: Floats) -> Floats:
    """Center of mass farthest from where a rest appears, among those without other rests than a
    center (3,) has."""
    place, depth = within.and_within(stability.without_new_rests(center)).deepest
    is_deeper = 0.0 < depth < np.inf and stability.count(place) <= stability.count(center)
    return place if is_deeper else center


def _one_less(stability: Stability, within: Halfspaces, center: Floats) -> Floats | None:
    """Center of mass with one rest less and no new rest; None if there is none."""
    hull = stability.hull
    is_rest = stability.outermost(center)[1] > 0.0
    if is_rest.sum() == 1:
        return None
    room = within.and_within(stability.without_new_rests(center))
    heights = stability.sides.heights(center)
    own = np.flatnonzero(is_rest[hull.facet])
    for edge in own[np.argsort(heights[own], kind="stable")]:
        place, depth = room.and_within(stability.beyond(np.array([edge]))).deepest
        if LEAST_DEPTH * hull.diameter < depth < np.inf:
            return place
    return None


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
