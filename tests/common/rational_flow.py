"""An independent answer without rounding: who rolls where, in integers.

A plain transcription of algorithms 1 to 3 for a hull whose facets are exactly flat. Facets roll
over the point of their border that is nearest to the center of mass, and flow lines leave a cell by
the intersection of two planes, found among all edges of the cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise

import numpy as np
from common.exact_vectors import cross, dot, minus

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["Balanced", "RationalFlow"]

Vector = tuple[int, ...]

Border = tuple[int, tuple[int, int], list[list[tuple[int, int]]], list[int]]
"""Half-edge of a saddle; facets on which the body ends up to its left and right; edges (tail, head)
that the branches into the cells of its head and its tail cross; the maxima at which they end."""


class Balanced(Exception):
    """A sign that decides is zero."""


class RationalFlow:
    """The flow of one body."""

    def __init__(self, hull: ConvexHull, center: Floats) -> None:
        self.hull = hull
        *corners, origin = _integers(np.concatenate([hull.vertices, center[None]]))
        self.r = [minus(x, origin) for x in corners]
        self.polygons = [
            hull.tail[a:b].tolist()
            for a, b in zip(hull.facet_start[:-1], hull.facet_start[1:], strict=True)
        ]
        self.left: dict[tuple[int, int], int] = {}
        for facet, polygon in enumerate(self.polygons):
            for i, p in enumerate(polygon):
                self.left[polygon[i - 1], p] = facet
        self.normals = [self._normal(polygon) for polygon in self.polygons]
        self.neighbors: dict[int, list[int]] = {}
        for p, q in self.left:
            self.neighbors.setdefault(p, []).append(q)

    def _normal(self, polygon: list[int]) -> Vector:
        first = self.r[polygon[0]]
        fan = [minus(self.r[p], first) for p in polygon[1:]]
        parts = [cross(a, b) for a, b in pairwise(fan)]
        return tuple(sum(part) for part in zip(*parts, strict=True))

    def grows(self, p: int, q: int) -> bool:
        """Whether distance from the center grows from p to q, at p."""
        return _sign(dot(self.r[p], minus(self.r[q], self.r[p]))) > 0

    def is_inside(self, p: int, q: int) -> bool:
        """Whether the foot of the center on the facet left of p q is on the inner side of it."""
        return _sign(dot(self.normals[self.left[p, q]], cross(self.r[p], self.r[q]))) > 0

    def is_hinge(self, p: int, q: int) -> bool:
        return not self.grows(p, q) and not self.grows(q, p)

    def is_maximum(self, p: int) -> bool:
        return not any(self.grows(p, q) for q in self.neighbors[p])

    def is_stable(self, facet: int) -> bool:
        return all(self.is_inside(p, q) for p, q in self._sides(facet))

    def is_saddle(self, p: int, q: int) -> bool:
        return self.is_hinge(p, q) and self.is_inside(p, q) and self.is_inside(q, p)

    def _sides(self, facet: int) -> list[tuple[int, int]]:
        polygon = self.polygons[facet]
        return [(polygon[i - 1], p) for i, p in enumerate(polygon)]

    def destined(self, facet: int) -> int:
        """The stable facet to which a body rolls that stands on a facet."""
        while not self.is_stable(facet):
            facet = self._rolled(facet)
        return facet

    def _rolled(self, facet: int) -> int:
        distances = {}
        for p, q in self._sides(facet):
            v = minus(self.r[q], self.r[p])
            distances[p, p] = Fraction(dot(self.r[p], self.r[p]))
            if self.is_hinge(p, q):
                turned = cross(self.r[p], v)
                distances[p, q] = Fraction(dot(turned, turned), dot(v, v))
        p, q = min(distances, key=distances.__getitem__)
        return self.left[q, p] if p != q else self._slide(facet, p)

    def _slide(self, facet: int, p: int) -> int:
        """The facet that a body reaches which tips from a facet onto its corner p."""
        u = self.normals[facet]
        entries = {q for q in self.neighbors[p] if facet in (self.left[p, q], self.left[q, p])}
        while True:
            q, u = self._leave(u, p, entries)
            if self.is_hinge(p, q):
                v = minus(self.r[q], self.r[p])
                # The saddle's plane cuts the edge's arc into the parts that tip left and right.
                return (
                    self.left[p, q] if _sign(dot(self.r[p], cross(v, u))) > 0 else self.left[q, p]
                )
            p, entries = q, {p}

    def _climb(self, p: int, q: int) -> tuple[list[tuple[int, int]], int]:
        """From the saddle of an edge into the cell of its end p."""
        v = minus(self.r[q], self.r[p])
        u = cross(v, cross(self.r[p], v))
        crossed = []
        while not self.is_maximum(p):
            head, u = self._leave(u, p, {q})
            crossed.append((p, head))
            p, q = head, p
        return crossed, p

    def _leave(self, u: Vector, p: int, entries: set[int]) -> tuple[int, Vector]:
        """Where the great circle through u and r_p leaves the cell of p, other than through the
        arcs of the edges to `entries`, on which u lies: the neighbouring cell and the point."""
        plane = cross(u, self.r[p])
        found = []
        for q in self.neighbors[p]:
            a, b = self.normals[self.left[p, q]], self.normals[self.left[q, p]]
            beyond, before = dot(plane, a), dot(plane, b)
            if q not in entries and _sign(beyond) != _sign(before):
                beyond, before = abs(beyond), abs(before)
                point = tuple(before * x + beyond * y for x, y in zip(a, b, strict=True))
                found.append((q, point))
        assert len(found) == 1
        return found[0]

    def rests(self) -> list[int]:
        return [facet for facet in range(len(self.polygons)) if self.is_stable(facet)]

    def borders(self) -> Iterator[Border]:
        """Of the saddles that divide two basins."""
        for half_edge, twin in enumerate(self.hull.twin.tolist()):
            p, q = int(self.hull.tail[half_edge]), int(self.hull.tail[twin])
            if half_edge > twin or not self.is_saddle(p, q):
                continue
            sides = self.destined(self.left[p, q]), self.destined(self.left[q, p])
            if sides[0] != sides[1]:
                branches = [self._climb(q, p), self._climb(p, q)]
                crossed, ends = zip(*branches, strict=True)
                yield half_edge, sides, list(crossed), list(ends)


def _integers(points: Floats) -> list[Vector]:
    """Points (n, 3) times a power of two."""
    exact = [[Fraction(x) for x in point] for point in points.tolist()]
    scale = max(x.denominator for point in exact for x in point)
    return [tuple(int(x * scale) for x in point) for point in exact]


def _sign(value: int) -> int:
    if value == 0:
        raise Balanced
    return 1 if value > 0 else -1
