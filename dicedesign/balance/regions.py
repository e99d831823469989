"""Where a center of mass may be, as half-spaces, and those that say which facets a body rests on.

A body rests on a facet where its center of mass is above it: inside of a plane through each edge,
upright on the facet. Where probabilities jump, the center of mass crosses such a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

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
        """All that is inside a hull."""
        return cls(hull.normals, hull.heights(np.zeros(3)))

    def heights(self, point: Floats) -> Floats:
        """(m,) distances of the planes from a point (3,), negative where it is outside."""
        return self.offsets - self.normals @ point

    def and_within(self, other: Halfspaces) -> Halfspaces:
        """Intersection of two regions."""
        return Halfspaces(
            np.concatenate([self.normals, other.normals]),
            np.concatenate([self.offsets, other.offsets]),
        )

    @cached_property
    def deepest(self) -> tuple[Floats, float]:
        """The point (3,) whose least distance from the planes is largest, and that distance; it is
        not above 0 where nothing is inside, and infinite where that is unbounded."""
        middle = self.normals.T @ self.offsets / len(self.offsets)
        move, depth = deepest_point(self.normals, self.heights(middle))
        return middle + move, depth

    def corners(self) -> ConvexHull | None:
        """The polyhedron that is inside, which has to be bounded; None where there is none."""
        middle, depth = self.deepest
        if not 0.0 < depth < np.inf:
            return None
        try:
            return convex_hull(middle + polyhedron_corners(self.normals, self.heights(middle)))
        except DegenerateBodyError:
            return None


def box_region(low: Floats, high: Floats) -> Halfspaces:
    """A box along the axes, from its least (3,) to its largest coordinates (3,). Raises InputError
    where they are none."""
    if not (np.isfinite([low, high]).all() and (low < high).all()):
        raise InputError(
            "region: expected a box, its least x,y,z and then its largest, got "
            f"{', '.join(f'{x:g}' for x in (*low, *high))}; each of the last three is to be larger"
        )
    return Halfspaces(np.concatenate([-np.eye(3), np.eye(3)]), np.concatenate([-low, high]))


def points_within(hull: ConvexHull, count: int) -> Floats:
    """(count, 3) points that fill a hull evenly, deterministic."""
    middle = hull.centroid
    corners = hull.vertices[hull.triangles] - middle
    volumes = np.abs(np.linalg.det(corners))
    draws = qmc.Halton(4, scramble=False).random(count + 1)[1:]
    which = np.searchsorted(np.cumsum(volumes) / volumes.sum(), draws[:, 0]).clip(
        max=len(volumes) - 1
    )
    # Of a tetrahedron: the differences of three ordered numbers are the weights of its corners.
    steps = np.sort(draws[:, 1:], axis=1)
    weights = np.diff(steps, axis=1, prepend=0.0)
    return np.asarray(middle + (weights[:, :, None] * corners[which]).sum(axis=1))


UNSHIFTED: Final = 1e-6
"""Distance of the center of mass from that of the uniform solid, over the diagonal, for which no
cavity is made: in the single precision of a file it would be none."""

REGULAR: Final = 1e-9
"""Part of its trace that is added to the quadratic form: one direction may be free."""


def least_within(form: Floats, slope: Floats, normals: Floats, heights: Floats) -> Floats:
    """(3,) the point x with `normals @ x <= heights` where `x . form x / 2 + slope . x` is least.

    form: (3, 3) symmetric, not negative; slope: (3,); normals: (m, 3); heights: (m,), which leave
    a point.

    Source: Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance
    programming by nonnegative least squares).
    """
    root = np.linalg.cholesky(form + REGULAR * np.trace(form) * np.eye(3))
    # In y = root^T x + offset the distance from the origin is to be least.
    offset = np.linalg.solve(root, slope)
    rows = -np.linalg.solve(root, normals.T)
    bounds = offset @ rows - heights
    system, wanted = np.vstack([rows, bounds]), np.eye(4)[3]
    rest = system @ nnls(system, wanted)[0] - wanted
    return np.asarray(np.linalg.solve(root.T, -rest[:3] / rest[3] - offset))


@dataclass(frozen=True, eq=False)
class Stability:
    """Prisms above the facets of a hull."""

    hull: ConvexHull

    @cached_property
    def sides(self) -> Halfspaces:
        """The plane of each half-edge, whose normal points out of its facet."""
        hull = self.hull
        tails = hull.vertices[hull.tail]
        edges = hull.vertices[hull.head] - tails
        normals = unit_vectors(np.linalg.cross(edges, hull.normals[hull.facet]))
        return Halfspaces(normals, (tails * normals).sum(axis=1))

    def outermost(self, center: Floats) -> tuple[Integers, Floats]:
        """(m,) half-edge of each facet whose side is nearest to a center of mass (3,), or farthest
        within it, and (m,) its distance, negative where the body does not rest on the facet."""
        heights = self.sides.heights(center)
        start = self.hull.facet_start[:-1]
        least = np.minimum.reduceat(heights, start)
        # The first of each facet that is least.
        lowest = np.flatnonzero(heights == least[self.hull.facet])
        _, first = np.unique(self.hull.facet[lowest], return_index=True)
        return lowest[first], least

    def counts(self, centers: Floats) -> Integers:
        """(n,) numbers of facets that the body rests on with centers of mass (n, 3)."""
        return np.array([(self.outermost(center)[1] > 0.0).sum() for center in centers])

    def clearance(self, center: Floats) -> float:
        """Distance from a center of mass (3,) to where a rest appears or vanishes: no more than
        this."""
        return float(np.abs(self.outermost(center)[1]).min())

    def cell(self, center: Floats, clearance: float = 0.0) -> Halfspaces:
        """Region of centers of mass around one (3,) with exactly the same rests, in part: each
        lies on the same side of all other facets' planes. Planes are moved inward by a distance."""
        edges, least = self.outermost(center)
        inner = (least > 0.0)[self.hull.facet]
        inside = Halfspaces(self.sides.normals[inner], self.sides.offsets[inner] - clearance)
        return inside.and_within(self.beyond(edges[least <= 0.0], clearance))

    def beyond(self, edges: Integers, clearance: float = 0.0) -> Halfspaces:
        """Region of centers of mass beyond the sides of half-edges, by a distance."""
        return Halfspaces(-self.sides.normals[edges], -self.sides.offsets[edges] - clearance)


def is_shifted(surface: Surface, center_of_mass: Floats) -> bool:
    """Whether a center of mass (3,) differs from that of the uniform solid."""
    shift = float(norms(center_of_mass - surface.centroid))
    return shift > UNSHIFTED * surface.diagonal
