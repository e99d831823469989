"""The forward model's decisions in integer arithmetic, for when rounding could change them.

Coordinates are floats, so a power of two makes integers of them all, and every decision is the sign
of a polynomial in them.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from math import gcd
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.hull import ConvexHull

__all__ = ["ExactSigns"]

Vector = tuple[int, int, int]
Booleans = NDArray[np.bool_]
Integers = NDArray[np.int64]


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
        self._center = center
        self._vectors: dict[int, Vector] = {}
        self._normals: dict[int, Vector] = {}

    def growth(self, half_edge: int) -> int:
        """1 if distance from c grows along a half-edge at its start, else -1."""
        p = int(self._hull.tail[half_edge])
        return _sign(_dot(self._radius(p), self._edge(half_edge)))

    def side(self, half_edge: int) -> int:
        """1 if the foot of c on the half-edge's facet is inside of the edge, else -1."""
        p = int(self._hull.tail[half_edge])
        normal = self._area_vector(int(self._hull.facet[half_edge]))
        across = _cross(self._edge(half_edge), normal)
        return _sign(_dot(self._radius(p), across))

    def ascend(self, elements: Classified, saddle: int, vertex: int) -> tuple[list[int], int]:
        """Half-edges that the flow line from a saddle's half-edge into the cell of one of its ends
        crosses uphill, and the maximum it ends at."""
        v = self._edge(saddle)
        u = _project(self._radius(int(self._hull.tail[saddle])), v, v)
        crossed = []
        while not elements.maximum[vertex]:
            r = self._radius(vertex)
            edge = self._exit(elements, vertex, _cross(u, r), elements.ascending)
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
            edge = self._exit(elements, vertex, _cross(r, u), elements.descending)
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
        left = _sign(_dot(r, _cross(self._edge(edge), u))) > 0
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
        return _sign(_dot(left_of_travel, self._area_vector(facet)))

    @cached_property
    def _exponent(self) -> int:
        """Every coordinate times 2 to this power is an integer."""
        values = np.concatenate([self._hull.vertices.ravel(), self._center])
        exponents = np.frexp(values[values != 0.0])[1]
        return 53 - int(exponents.min()) if len(exponents) else 0

    def _integers(self, point: NDArray[np.float64]) -> Vector:
        mantissas, exponents = np.frexp(point)
        x, y, z = (
            int(m * 2.0**53) << max(int(e) - 53 + self._exponent, 0)
            for m, e in zip(mantissas, exponents, strict=True)
        )
        return x, y, z

    @cached_property
    def _origin(self) -> Vector:
        return self._integers(self._center)

    def _radius(self, vertex: int) -> Vector:
        if vertex not in self._vectors:
            self._vectors[vertex] = _minus(
                self._integers(self._hull.vertices[vertex]), self._origin
            )
        return self._vectors[vertex]

    def _edge(self, half_edge: int) -> Vector:
        hull = self._hull
        return _minus(
            self._radius(int(hull.head[half_edge])), self._radius(int(hull.tail[half_edge]))
        )

    def _area_vector(self, facet: int) -> Vector:
        """Normal of a facet's polygon, times twice its area."""
        if facet not in self._normals:
            self._normals[facet] = self._new_area_vector(facet)
        return self._normals[facet]

    def _new_area_vector(self, facet: int) -> Vector:
        start, end = self._hull.facet_start[facet], self._hull.facet_start[facet + 1]
        corners = [self._radius(int(p)) for p in self._hull.tail[start:end]]
        total = (0, 0, 0)
        for a, b in pairwise(corners[1:]):
            turn = _cross(_minus(a, corners[0]), _minus(b, corners[0]))
            total = (total[0] + turn[0], total[1] + turn[1], total[2] + turn[2])
        return total


def _dot(a: Vector, b: Vector) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _sign(value: int) -> int:
    return 1 if value > 0 else -1


def _project(u: Vector, along: Vector, normal: Vector) -> Vector:
    """`geometry.sphere.oblique_projection`, with common factors taken out."""
    scale, shift = _dot(along, normal), _dot(u, normal)
    x, y, z = (a * scale - b * shift for a, b in zip(u, along, strict=True))
    common = gcd(x, y, z) or 1
    return x // common, y // common, z // common
