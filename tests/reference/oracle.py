"""Oracle: an independent, plain forward model in 60 decimal digits, to judge float64 results.

It shares no code with `dicedesign.rest`: it is given a convex polyhedron as corners and facet
polygons and decides everything itself. Arcs are crossed by intersecting planes, areas are sums of
spherical excesses. Slow, and meant for a few hundred facets.
Source: eq. 7 to 10 and algorithms 1 to 3.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

Number = Any
"""An `mpmath.mpf`; all functions here expect to run within `mpmath.workdps(DIGITS)`."""

Numbers = NDArray[Any]
"""Array of such numbers."""

DIGITS = 60
"""Decimal digits of the arithmetic."""

ZERO = 1e-40
"""Relative size below which a sum of products counts as zero. Sums for bodies with float64
coordinates are hardly ever so small without being zero."""

REFERENCE = (0.48, 0.31, -0.82)
"""Reference direction of areas, any direction that is on no border."""

CLOSURE = 1e-40
"""Tolerance on the sum of the areas of the basins, in steradian."""

exact = np.frompyfunc(mpmath.mpf, 1, 1)
"""Converts numbers to an array of mpmath numbers, without rounding."""


class OracleError(ArithmeticError):
    """A body balances exactly, or its facets are not a convex polyhedron."""


class Balanced(OracleError):
    """A decisive sign is zero."""


def cross(a: Numbers, b: Numbers) -> Numbers:
    """Vector product of (3,) and (3,)."""
    (x, y, z), (u, v, w) = a, b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def length(a: Numbers) -> Number:
    return mpmath.sqrt(a @ a)


def unit(a: Numbers) -> Numbers:
    return a / length(a)


def sign(a: Numbers, b: Numbers) -> int:
    """Sign of a . b, 1 or -1. Raises Balanced where it is zero."""
    x, y, z = a * b
    value = x + y + z
    if abs(value) <= ZERO * (abs(x) + abs(y) + abs(z)):
        raise Balanced("oracle: expected a sign, got zero; the body balances exactly")
    return 1 if value > 0 else -1


def spherical_excess(k: Numbers, a: Numbers, b: Numbers) -> Number:
    """Signed area of the spherical triangle of unit vectors k, a, b, positive if they turn
    counter-clockwise seen from outside: 2 pi less its outer angles."""
    ka, ab, bk = cross(k, a), cross(a, b), cross(b, k)
    if length(ab) <= ZERO:
        return mpmath.mpf(0)
    excess = 2 * mpmath.pi - sum(
        mpmath.atan2(length(cross(one, other)), one @ other)
        for one, other in ((ka, ab), (ab, bk), (bk, ka))
    )
    return excess if k @ ab > 0 else -excess


def solid_centroid(vertices: Numbers, triangles: Sequence[Sequence[int]]) -> Numbers:
    """Mean of the centers of the tetrahedra between the first corner and each facet, by volume.

    triangles: corners of each facet, all counter-clockwise from outside or all from inside.
    """
    volume, moment = mpmath.mpf(0), exact(np.zeros(3))
    for a, b, c in triangles:
        x, y, z = vertices[a] - vertices[0], vertices[b] - vertices[0], vertices[c] - vertices[0]
        sixfold = x @ cross(y, z)
        volume += sixfold
        moment = moment + sixfold / 4 * (x + y + z)
    return vertices[0] + moment / volume


def oracle_probabilities(
    vertices: Any, polygons: Sequence[Sequence[int]], centers: Sequence[Any]
) -> list[Number]:
    """Resting probability of each facet, the mean over the given centers of mass.

    vertices: (n, 3) corners of a convex polyhedron, floats or mpmath numbers, any length unit.
    polygons: m lists of corners, counter-clockwise seen from outside.
    centers: one center of mass (3,) inside, or the two beside a tied body's.

    Returns m mpmath numbers, 0 for facets that are no rests.

    Raises OracleError: the body balances exactly for one of the centers, or its basins do not
    close.
    """
    with mpmath.workdps(DIGITS):
        areas = [Oracle(vertices, polygons, center).areas() for center in centers]
        return [sum(of) / (4 * mpmath.pi * len(centers)) for of in zip(*areas, strict=True)]


def hull_probabilities(hull: ConvexHull, centers: Sequence[Floats]) -> list[Number]:
    """Resting probability of each facet of a hull; see `oracle_probabilities`."""
    return oracle_probabilities(hull.vertices, facet_polygons(hull), centers)


def facet_polygons(hull: ConvexHull) -> list[list[int]]:
    """List the corners of each facet, for `oracle_probabilities`."""
    return [polygon.tolist() for polygon in np.split(hull.tail, hull.facet_start[1:-1])]


class Oracle:
    """A polyhedron with a center of mass, which is the origin of the corners `r`."""

    def __init__(self, vertices: Any, polygons: Sequence[Sequence[int]], center: Any) -> None:
        self.r = exact(vertices) - exact(center)
        self.sides = [list(pairwise([*polygon, polygon[0]])) for polygon in polygons]
        self.left: dict[tuple[int, int], int] = {}
        self.neighbors: dict[int, list[int]] = {}
        self.normals: list[Numbers] = []
        for facet, sides in enumerate(self.sides):
            first, total = self.r[sides[0][0]], exact(np.zeros(3))
            for p, q in sides:
                self.left[p, q] = facet
                self.neighbors.setdefault(p, []).append(q)
                total = total + cross(self.r[p] - first, self.r[q] - first)
            self.normals.append(unit(total))
        self.destiny: dict[int, int] = {}

    def edge(self, p: int, q: int) -> Numbers:
        return self.r[q] - self.r[p]

    def grows(self, p: int, q: int) -> bool:
        """Whether distance from the center grows from p to q, at p."""
        return sign(self.r[p], self.edge(p, q)) > 0

    def is_hinge(self, p: int, q: int) -> bool:
        v = self.edge(p, q)
        return sign(self.r[p], v) < 0 < sign(self.r[q], v)

    def is_maximum(self, p: int) -> bool:
        return not any(self.grows(p, q) for q in self.neighbors[p])

    def is_inside(self, p: int, q: int) -> bool:
        """Whether the foot of the center on the facet left of p q is on the inner side of this
        edge."""
        return sign(self.normals[self.left[p, q]], cross(self.r[p], self.r[q])) > 0

    def is_stable(self, facet: int) -> bool:
        return all(self.is_inside(p, q) for p, q in self.sides[facet])

    def saddle(self, p: int, q: int) -> Numbers:
        """Direction from the center to the nearest point of the edge's line (eq. 7, 8)."""
        v = self.edge(p, q)
        return unit(self.r[p] - self.r[p] @ v / (v @ v) * v)

    def is_saddle(self, p: int, q: int) -> bool:
        if not self.is_hinge(p, q):
            return False
        v, s = self.edge(p, q), self.saddle(p, q)
        left, right = self.normals[self.left[p, q]], self.normals[self.left[q, p]]
        return sign(v, cross(left, s)) > 0 and sign(v, cross(s, right)) > 0

    def destined(self, facet: int) -> int:
        """Stable facet to which a body rolls from a facet."""
        if facet not in self.destiny:
            stable = self.is_stable(facet)
            self.destiny[facet] = facet if stable else self.destined(self.roll(facet))
        return self.destiny[facet]

    def roll(self, facet: int) -> int:
        """Facet that follows an unstable facet, over the point of its border nearest to the
        center."""
        squares = {}
        for p, q in self.sides[facet]:
            v = self.edge(p, q)
            squares[p, p] = self.r[p] @ self.r[p]
            if self.is_hinge(p, q):
                turned = cross(self.r[p], v)
                squares[p, q] = turned @ turned / (v @ v)
        p, q = min(squares, key=squares.__getitem__)
        return self.slide(facet, p) if p == q else self.left[q, p]

    def slide(self, facet: int, p: int) -> int:
        """Facet that a body reaches when it tips from a facet onto its corner p."""
        u = self.normals[facet]
        entries = {q for q in self.neighbors[p] if facet in (self.left[p, q], self.left[q, p])}
        while True:
            q, u = self.leave(u, p, entries)
            if self.is_hinge(p, q):
                beyond = sign(self.edge(p, q), cross(self.saddle(p, q), u)) > 0
                return self.left[q, p] if beyond else self.left[p, q]
            p, entries = q, {p}

    def ascend(self, p: int, q: int) -> tuple[list[Numbers], list[int]]:
        """Points of the separatrix from the saddle of edge p q into the cell of p, and the corners
        of the cells on its way."""
        points, cells = [self.saddle(p, q)], [p]
        while not self.is_maximum(p):
            crossed, u = self.leave(points[-1], p, {q})
            points.append(u)
            cells.append(crossed)
            p, q = crossed, p
        return [*points, unit(self.r[p])], cells

    def leave(self, u: Numbers, p: int, entries: set[int]) -> tuple[int, Numbers]:
        """Neighboring cell and point where the great circle through u and r_p leaves the cell of p,
        except through the arcs of the edges to `entries`, on which u is."""
        plane = cross(u, self.r[p])
        exits = []
        for q in self.neighbors[p]:
            a, b = self.normals[self.left[p, q]], self.normals[self.left[q, p]]
            if q not in entries and sign(plane, a) != sign(plane, b):
                point = unit(cross(plane, self.edge(p, q)))
                exits.append((q, point if point @ (a + b) > 0 else -point))
        if len(exits) != 1:
            raise OracleError(f"oracle: expected one way out of cell {p}, got {len(exits)}")
        return exits[0]

    def rests(self) -> list[int]:
        return [facet for facet in range(len(self.sides)) if self.is_stable(facet)]

    def borders(self) -> Iterator[tuple[int, int, int, int]]:
        """Yield the saddles that divide two basins: the corners p, q of the edge, and the rests to
        its left and right."""
        done = set()
        for p, q in self.left:
            done.add((p, q))
            if (q, p) not in done and self.is_saddle(p, q):
                left, right = self.destined(self.left[p, q]), self.destined(self.left[q, p])
                if left != right:
                    yield p, q, left, right

    def areas(self) -> list[Number]:
        pi, reference = mpmath.pi, unit(exact(REFERENCE))
        total, rests = [0 * pi for _ in self.sides], self.rests()
        if len(rests) == 1:
            total[rests[0]] = 4 * pi
            return total
        for p, q, left, right in self.borders():
            border = [*reversed(self.ascend(p, q)[0]), *self.ascend(q, p)[0][1:]]
            swept = sum(spherical_excess(reference, a, b) for a, b in pairwise(border))
            total[left] += swept
            total[right] -= swept
        for facet in rests:
            total[facet] %= 4 * pi
        if abs(sum(total) - 4 * pi) > CLOSURE:
            raise OracleError("oracle: expected basins that cover the sphere once")
        return total
