"""The forward model once more, plainly, in 60 decimal digits: the measure of float64 results.

It shares no code with `dicedesign.rest`: it is given a convex polyhedron as corners and facet
polygons and decides everything itself. Arcs are crossed by intersecting planes, areas are sums of
spherical excesses. Slow, and meant for a few hundred facets.
Source: eq. 7 to 10 and algorithms 1 to 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

Number = Any
"""An `mpmath.mpf`; all functions here expect to run within `mpmath.workdps(DIGITS)`."""

Vector = tuple[Number, Number, Number]

DIGITS: Final = 60
"""Decimal digits of all arithmetic."""

ZERO: Final = 1e-40
"""A sum of products below this part of its terms' magnitude counts as zero. No sum that decides
about a body with float64 coordinates is likely to come near it without being zero."""


class OracleError(ArithmeticError):
    """A body has no one answer, as it balances exactly, or its facets are no convex polyhedron."""


def multiprecision() -> ModuleType:
    """The package mpmath. Raises InputError where it is not installed."""
    try:
        import mpmath
    except ImportError as error:
        raise InputError(
            "oracle: expected the package mpmath, which is not installed; "
            "pip install 'dicedesign[bench]' brings it"
        ) from error
    module: ModuleType = mpmath
    return module


def vector(x: Sequence[Any]) -> Vector:
    """Three floats or mpmath numbers as they are, without rounding."""
    mpf = multiprecision().mpf
    return mpf(x[0]), mpf(x[1]), mpf(x[2])


def dot(a: Vector, b: Vector) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(factor: Number, a: Vector) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def unit(a: Vector) -> Vector:
    length = _length(a)
    return a[0] / length, a[1] / length, a[2] / length


def sign(a: Vector, b: Vector) -> int:
    """Sign of a . b, 1 or -1. Raises OracleError where it is zero."""
    terms = a[0] * b[0], a[1] * b[1], a[2] * b[2]
    value = sum(terms)
    if abs(value) <= ZERO * sum(map(abs, terms)):
        raise OracleError("oracle: expected a sign, got zero; the body balances exactly")
    return 1 if value > 0 else -1


def spherical_excess(k: Vector, a: Vector, b: Vector) -> Number:
    """Signed area of the spherical triangle of unit vectors k, a, b, positive if they turn
    counter-clockwise seen from outside: 2 pi less its outer angles."""
    ka, ab, bk = cross(k, a), cross(a, b), cross(b, k)
    if _length(ab) <= ZERO:
        return multiprecision().mpf(0)
    excess = 2 * multiprecision().pi - _angle(ka, ab) - _angle(ab, bk) - _angle(bk, ka)
    return excess if dot(k, ab) > 0 else -excess


def solid_centroid(vertices: Sequence[Vector], triangles: Sequence[Sequence[int]]) -> Vector:
    """Mean of the centers of the tetrahedra between the first corner and each facet, by volume.

    triangles: corners of each facet, all counter-clockwise from outside or all from inside.
    """
    apex = vertices[0]
    volume, moment = vector((0, 0, 0))[0], vector((0, 0, 0))
    for a, b, c in triangles:
        x, y, z = (minus(vertices[corner], apex) for corner in (a, b, c))
        sixfold = dot(x, cross(y, z))
        volume += sixfold
        moment = plus(moment, times(sixfold / 4, plus(x, plus(y, z))))
    return plus(apex, times(1 / volume, moment))


def _angle(a: Vector, b: Vector) -> Number:
    return multiprecision().atan2(_length(cross(a, b)), dot(a, b))


def _length(a: Vector) -> Number:
    return multiprecision().sqrt(dot(a, a))


Vectors = Sequence[Sequence[Any]]

Edge = tuple[int, int]

REFERENCE: Final = (0.48, 0.31, -0.82)
"""A direction from which areas are measured; any will do that is on no border."""

CLOSURE: Final = 1e-40
"""Steradian by which the basins may miss the whole sphere."""


def oracle_probabilities(
    vertices: Vectors, polygons: Sequence[Sequence[int]], centers: Vectors
) -> list[Number]:
    """Resting probability of each facet, the mean over the given centers of mass.

    vertices: (n, 3) corners of a convex polyhedron, floats or mpmath numbers, any length unit.
    polygons: m lists of corners, counter-clockwise seen from outside.
    centers: one center of mass (3,) inside, or the two beside a tied body's.

    Returns m mpmath numbers, 0 for facets that are no rests.

    Raises
    ------
    InputError: mpmath is not installed.
    OracleError: the body balances exactly for one of the centers, or its basins do not close.
    """
    mp = multiprecision()
    with mp.workdps(DIGITS):
        areas = [_Oracle(vertices, polygons, center).areas() for center in centers]
        return [sum(of_facet) / (4 * mp.pi * len(centers)) for of_facet in zip(*areas, strict=True)]


def hull_probabilities(hull: ConvexHull, centers: Sequence[NDArray[np.float64]]) -> list[Number]:
    """`oracle_probabilities` of a hull's facets, for centers of mass (3,); raises the same."""
    points = [center.tolist() for center in centers]
    return oracle_probabilities(hull.vertices.tolist(), facet_polygons(hull), points)


def facet_polygons(hull: ConvexHull) -> list[list[int]]:
    """The corners of each facet, as `oracle_probabilities` wants them."""
    return [polygon.tolist() for polygon in np.split(hull.tail, hull.facet_start[1:-1])]


class _Oracle:
    """One polyhedron with one center of mass, which is the origin of `r`."""

    def __init__(
        self, vertices: Vectors, polygons: Sequence[Sequence[int]], center: Sequence[Any]
    ) -> None:
        origin = vector(center)
        self.r = [minus(vector(x), origin) for x in vertices]
        self.polygons = polygons
        self.left: dict[Edge, int] = {}
        self.neighbors: list[list[int]] = [[] for _ in self.r]
        self.normals: list[Vector] = []
        for facet, polygon in enumerate(self.polygons):
            first, total = self.r[polygon[0]], vector((0, 0, 0))
            for p, q in _sides(polygon):
                self.left[p, q] = facet
                self.neighbors[p].append(q)
                total = plus(total, cross(minus(self.r[p], first), minus(self.r[q], first)))
            self.normals.append(unit(total))
        self.destiny: dict[int, int] = {}

    def edge(self, p: int, q: int) -> Vector:
        return minus(self.r[q], self.r[p])

    def is_hinge(self, p: int, q: int) -> bool:
        v = self.edge(p, q)
        return sign(self.r[p], v) < 0 < sign(self.r[q], v)

    def is_maximum(self, p: int) -> bool:
        return all(sign(self.r[p], self.edge(p, q)) < 0 for q in self.neighbors[p])

    def is_stable(self, facet: int) -> bool:
        """Whether the center's foot is on the inner side of all the facet's edges."""
        n, r = self.normals[facet], self.r
        return all(sign(n, cross(r[p], r[q])) > 0 for p, q in _sides(self.polygons[facet]))

    def saddle(self, p: int, q: int) -> Vector:
        """Direction from the center to the nearest point of the edge's line (eq. 7, 8)."""
        v = self.edge(p, q)
        t = -dot(self.r[p], v) / dot(v, v)
        return unit(plus(self.r[p], times(t, v)))

    def is_saddle(self, p: int, q: int) -> bool:
        if not self.is_hinge(p, q):
            return False
        v, s = self.edge(p, q), self.saddle(p, q)
        left, right = self.normals[self.left[p, q]], self.normals[self.left[q, p]]
        return sign(v, cross(left, s)) > 0 and sign(v, cross(s, right)) > 0

    def destined(self, facet: int) -> int:
        """The stable facet to which a body rolls that stands on a facet."""
        if facet not in self.destiny:
            stable = self.is_stable(facet)
            self.destiny[facet] = facet if stable else self.destined(self.roll(facet))
        return self.destiny[facet]

    def roll(self, facet: int) -> int:
        """The facet that follows one that is not stable: over the point of its border nearest to
        the center."""
        nearest: tuple[Number, Edge, bool] | None = None
        for p, q in _sides(self.polygons[facet]):
            v = self.edge(p, q)
            if self.is_hinge(p, q):
                turned = cross(self.r[p], v)
                found = dot(turned, turned) / dot(v, v), (p, q), True
            else:
                found = dot(self.r[p], self.r[p]), (p, q), False
            if nearest is None or found[0] < nearest[0]:
                nearest = found
        assert nearest is not None
        (p, q), over_edge = nearest[1:]
        return self.left[q, p] if over_edge else self.slide(facet, p)

    def slide(self, facet: int, p: int) -> int:
        """The facet that a body reaches which tips from a facet onto its corner p."""
        u = self.normals[facet]
        entries = {q for q in self.neighbors[p] if facet in (self.left[p, q], self.left[q, p])}
        while True:
            q, u = self.leave(u, p, entries)
            if self.is_hinge(p, q):
                beyond = sign(self.edge(p, q), cross(self.saddle(p, q), u)) > 0
                return self.left[q, p] if beyond else self.left[p, q]
            entries = {p}
            p = q

    def ascend(self, p: int, q: int) -> list[Vector]:
        """Points of the separatrix from the saddle of edge p q into the cell of p, to its end."""
        points = [self.saddle(p, q)]
        while not self.is_maximum(p):
            crossed, u = self.leave(points[-1], p, {q})
            points.append(u)
            p, q = crossed, p
        return [*points, unit(self.r[p])]

    def leave(self, u: Vector, p: int, entries: set[int]) -> tuple[int, Vector]:
        """Where the great circle through u and r_p leaves the cell of p, other than through the
        arcs of the edges to `entries`, on which u lies: the neighbouring cell and the point."""
        plane = cross(u, self.r[p])
        found = []
        for q in self.neighbors[p]:
            a, b = self.normals[self.left[p, q]], self.normals[self.left[q, p]]
            if q not in entries and sign(plane, a) != sign(plane, b):
                point = unit(cross(plane, self.edge(p, q)))
                found.append((q, times(1 if dot(point, plus(a, b)) > 0 else -1, point)))
        if len(found) != 1:
            raise OracleError(f"oracle: expected one way out of cell {p}, got {len(found)}")
        return found[0]

    def areas(self) -> list[Number]:
        pi, reference = multiprecision().pi, unit(vector(REFERENCE))
        total: list[Number] = [0 * pi for _ in self.polygons]
        rests = [facet for facet in range(len(total)) if self.is_stable(facet)]
        if len(rests) == 1:
            total[rests[0]] = 4 * pi
            return total
        for p, q in self.left:
            if p > q or not self.is_saddle(p, q):
                continue
            left, right = self.destined(self.left[p, q]), self.destined(self.left[q, p])
            if left != right:
                border = [*reversed(self.ascend(p, q)), *self.ascend(q, p)[1:]]
                swept = sum(spherical_excess(reference, a, b) for a, b in pairwise(border))
                total[left] += swept
                total[right] -= swept
        for facet in rests:
            total[facet] %= 4 * pi
        if abs(sum(total) - 4 * pi) > CLOSURE:
            raise OracleError("oracle: expected basins that cover the sphere once")
        return total


def _sides(polygon: Sequence[int]) -> list[Edge]:
    return list(zip(polygon, [*polygon[1:], polygon[0]], strict=True))


def exact_outcome_error(
    hull: ConvexHull, center: Floats | None, directions: Floats, target: Floats
) -> float:
    """Largest |p - q| of a die, each rest counted for the outcome whose direction is nearest.

    hull: the die; center: (3,) of mass, or None for that of the uniform solid, to 60 digits;
    directions: (k, 3) unit; target: (k,).

    Raises OracleError where the die balances exactly.
    """
    vertices, polygons = hull.vertices.tolist(), facet_polygons(hull)
    with multiprecision().workdps(DIGITS):
        middle: Any = center
        if center is None:
            middle = solid_centroid([vector(x) for x in vertices], hull.triangles.tolist())
        misses = [-vector((q, 0, 0))[0] for q in target.tolist()]
        exact = oracle_probabilities(vertices, polygons, [middle])
        for normal, probability in zip(hull.normals, exact, strict=True):
            misses[int(np.argmax(directions @ normal))] += probability
        return float(max(map(abs, misses)))
