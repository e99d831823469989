"""Convex regions in which a center of mass may be, as half-spaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import qmc

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.halfspaces import deepest_point, polyhedron_corners
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.runtime.arrays import Floats

__all__ = ["Halfspaces", "box_region", "points_within"]


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
        """What both have."""
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
    """(count, 3) points that fill a hull evenly, always the same."""
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
