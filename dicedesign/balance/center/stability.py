"""Which facets a body rests on, as half-spaces for its center of mass.

A body rests on a facet where its center of mass is above it: inside of a plane through each edge,
upright on the facet. Where odds jump, the center of mass crosses such a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dicedesign.balance.center.regions import Halfspaces
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.runtime.arrays import Booleans, Floats, Integers

__all__ = ["Stability"]


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
        found = np.flatnonzero(heights == least[self.hull.facet])
        _, first = np.unique(self.hull.facet[found], return_index=True)
        return found[first], least

    def counts(self, centers: Floats) -> Integers:
        """(n,) numbers of facets that the body rests on with centers of mass (n, 3)."""
        return np.array([(self.outermost(center)[1] > 0.0).sum() for center in centers])

    def clearance(self, center: Floats) -> float:
        """Distance from a center of mass (3,) to where a rest appears or vanishes: no more than
        this."""
        return float(np.abs(self.outermost(center)[1]).min())

    def cell(self, center: Floats, clearance: float = 0.0) -> Halfspaces:
        """Where the body has the same rests as with a center of mass (3,), and no others, in part:
        it is beyond the same side of all other facets. Planes are moved inward by a distance."""
        edges, least = self.outermost(center)
        return self._within(least > 0.0, clearance).and_within(
            self.beyond(edges[least <= 0.0], clearance)
        )

    def beyond(self, edges: Integers, clearance: float = 0.0) -> Halfspaces:
        """Where the center of mass is beyond the sides of half-edges, by a distance."""
        return Halfspaces(-self.sides.normals[edges], -self.sides.offsets[edges] - clearance)

    def _within(self, facets: Booleans, clearance: float) -> Halfspaces:
        kept = facets[self.hull.facet]
        return Halfspaces(self.sides.normals[kept], self.sides.offsets[kept] - clearance)
