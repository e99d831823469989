"""Regions of centers of mass as half-spaces, and the half-spaces that determine the rests of a
body.

A body rests on a facet if its center of mass is above it: on the inner side of the plane through
each edge that is perpendicular to the facet. Probabilities jump where the center of mass crosses
such a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

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
    volumes = np.abs(np.linalg.det(corners))
    draws = qmc.Halton(4, scramble=False).random(count + 1)[1:]
    which = np.searchsorted(np.cumsum(volumes) / volumes.sum(), draws[:, 0]).clip(
        max=len(volumes) - 1
    )
    # Differences of three sorted numbers are uniform weights of a tetrahedron's corners.
    steps = np.sort(draws[:, 1:], axis=1)
    weights = np.diff(steps, axis=1, prepend=0.0)
    return np.asarray(middle + (weights[:, :, None] * corners[which]).sum(axis=1))


UNSHIFTED: Final = 1e-6
"""Least shift of the center of mass relative to the diagonal; less is lost in the single precision
of a file."""

REGULAR: Final = 1e-9
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

    def counts(self, centers: Floats) -> Integers:
        """(n,) numbers of rests with centers of mass (n, 3)."""
        return np.array([(self.outermost(center)[1] > 0.0).sum() for center in centers])

    def clearance(self, center: Floats) -> float:
        """Upper bound of the distance from a center of mass (3,) to where a rest appears or
        vanishes."""
        return float(np.abs(self.outermost(center)[1]).min())

    def cell(self, center: Floats, clearance: float = 0.0) -> Halfspaces:
        """Convex region of centers of mass around one (3,) that have its rests. A facet that is no
        rest bounds it by its farthest side. Planes are moved inward by a clearance."""
        edges, least = self.outermost(center)
        inner = (least > 0.0)[self.hull.facet]
        inside = Halfspaces(self.sides.normals[inner], self.sides.offsets[inner] - clearance)
        return inside.and_within(self.beyond(edges[least <= 0.0], clearance))

    def beyond(self, edges: Integers, clearance: float = 0.0) -> Halfspaces:
        """Region of centers of mass beyond the sides of half-edges, by a clearance."""
        return Halfspaces(-self.sides.normals[edges], -self.sides.offsets[edges] - clearance)


def is_shifted(surface: Surface, center_of_mass: Floats) -> bool:
    """Whether a center of mass (3,) differs from the uniform solid's."""
    shift = float(norms(center_of_mass - surface.centroid))
    return shift > UNSHIFTED * surface.diagonal
