"""The forward model's decisions in integer arithmetic, for when rounding could change them.

Every decision is the sign of a polynomial in coordinates.
"""

from __future__ import annotations

from math import gcd
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.integers import IntegerPoints, Vector, area_vector, cross, dot, minus
from dicedesign.runtime.arrays import Booleans, Integers

__all__ = ["ExactSigns"]


class Classified(Protocol):
    """What is known of a hull's elements when paths are followed; see `Equilibria`."""

    @property
    def maximum(self) -> Booleans: ...
    @property
    def ascending(self) -> Booleans: ...
    @property
    def descending(self) -> Booleans: ...
    @property
    def hinge(self) -> Booleans: ...
    @property
    def side_sign(self) -> Integers: ...
    @property
    def roll_vertex(self) -> Integers: ...


class ExactSigns:
    """Signs for one hull and center of mass. A sign that is exactly zero counts as negative."""

    def __init__(self, hull: ConvexHull, center: NDArray[np.float64]) -> None:
        self._hull = hull
        self._integers = IntegerPoints(np.concatenate([hull.vertices, center[None]]))
        self._vectors: dict[int, Vector] = {}
        self._normals: dict[int, Vector] = {}

    def growth(self, half_edge: int) -> int:
        """1 if distance from c grows along a half-edge at its start, else -1."""
        p = int(self._hull.tail[half_edge])
        return _sign(dot(self._radius(p), self._edge(half_edge)))

    def side(self, half_edge: int) -> int:
        """1 if the foot of c on the half-edge's facet is inside of the edge, else -1."""
        p = int(self._hull.tail[half_edge])
        normal = self._area_vector(int(self._hull.facet[half_edge]))
        across = cross(self._edge(half_edge), normal)
        return _sign(dot(self._radius(p), across))

    def ascend(self, elements: Classified, saddle: int, vertex: int) -> tuple[list[int], int]:
        """Half-edges that the flow line from a saddle's half-edge into the cell of one of its ends
        crosses uphill, and the maximum it ends at."""
        v = self._edge(saddle)
        u = _project(self._radius(int(self._hull.tail[saddle])), v, v)
        crossed = []
        while not elements.maximum[vertex]:
            r = self._radius(vertex)
            edge = self._exit(elements, vertex, cross(u, r), elements.ascending)
            u = _project(u, r, self._edge(edge))
            crossed.append(edge)
            vertex = int(self._hull.head[edge])
        return crossed, vertex

    def descend(self, elements: Classified, facet: int) -> int:
        """Facet that a body slides to, over a hinge edge, which tips from a facet onto a vertex."""
        vertex = int(elements.roll_vertex[facet])
        u = self._area_vector(facet)
        while True:
            r = self._radius(vertex)
            edge = self._exit(elements, vertex, cross(r, u), elements.descending)
            x, y, z = _project(u, r, self._edge(edge))
            u = -x, -y, -z
            if elements.hinge[edge]:
                break
            vertex = int(self._hull.head[edge])
        twin = int(self._hull.twin[edge])
        if elements.side_sign[edge] < 0:
            return int(self._hull.facet[twin])
        if elements.side_sign[twin] < 0:
            return int(self._hull.facet[edge])
        left = _sign(dot(r, cross(self._edge(edge), u))) > 0
        return int(self._hull.facet[edge if left else twin])

    def _exit(
        self,
        elements: Classified,
        vertex: int,
        left_of_travel: Vector,
        allowed: Booleans,
    ) -> int:
        """As `tracing.exit_half_edges`, for one line."""
        hull = self._hull
        start, order = hull.outgoing
        candidates = [int(e) for e in order[start[vertex] : start[vertex + 1]] if allowed[e]]
        for edge in candidates:
            twin = int(hull.twin[edge])
            first = not allowed[hull.next[twin]]
            last = not allowed[hull.twin[hull.previous[edge]]]
            right_corner, left_corner = int(hull.facet[twin]), int(hull.facet[edge])
            if (first or self._beside(left_of_travel, right_corner) < 0) and (
                last or self._beside(left_of_travel, left_corner) > 0
            ):
                return edge
        # Only around facets that are flat no further than a tolerance.
        return candidates[0]

    def _beside(self, left_of_travel: Vector, facet: int) -> int:
        return _sign(dot(left_of_travel, self._area_vector(facet)))

    def _radius(self, vertex: int) -> Vector:
        if vertex not in self._vectors:
            origin = self._integers[len(self._hull.vertices)]
            self._vectors[vertex] = minus(self._integers[vertex], origin)
        return self._vectors[vertex]

    def _edge(self, half_edge: int) -> Vector:
        hull = self._hull
        return minus(
            self._radius(int(hull.head[half_edge])), self._radius(int(hull.tail[half_edge]))
        )

    def _area_vector(self, facet: int) -> Vector:
        """Normal of a facet's polygon, times twice its area."""
        if facet not in self._normals:
            start, end = self._hull.facet_start[facet], self._hull.facet_start[facet + 1]
            polygon = self._hull.tail[start:end]
            self._normals[facet] = area_vector([self._radius(int(p)) for p in polygon])
        return self._normals[facet]


def _sign(value: int) -> int:
    return 1 if value > 0 else -1


def _project(u: Vector, along: Vector, normal: Vector) -> Vector:
    """`geometry.sphere.oblique_projection`, with common factors taken out."""
    scale, shift = dot(along, normal), dot(u, normal)
    x, y, z = (a * scale - b * shift for a, b in zip(u, along, strict=True))
    common = gcd(x, y, z) or 1
    return x // common, y // common, z // common
