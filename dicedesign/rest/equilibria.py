"""Classification of a hull's facets, edges and vertices by how the body behaves on them.

Three signs decide everything: whether distance from the center of mass grows along a half-edge,
on which side of a facet's edge the foot of the center of mass lies, and (in `tracing`) on which
side of a facet normal a path passes. Where rounding could change a sign it is computed in integers
(`ExactSigns`): every decision is the sign of a polynomial in coordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.predicates import Exact, IntegerPoints, area_vector
from dicedesign.geometry.sphere import foot_on_line, norms
from dicedesign.kernels import ops as kernels
from dicedesign.kernels.ops import Tie
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import BOUNDARY_TOLERANCE, ROUNDING


class Surroundings(NamedTuple):
    """Lengths that decisions about a body are measured by.

    Attributes
    ----------
    facet: the facet whose plane is nearest to the center of mass, or farthest inside of it.
    height: distance of the center from this plane, negative outside.
    offset: largest difference of a coordinate of a vertex from the mean of all vertices.
    far: largest coordinate of vertices and center of mass.
    extent: largest extent of the vertices along an axis.
    """

    facet: int
    height: float
    offset: float
    far: float
    extent: float


def surroundings(hull: ConvexHull, center: NDArray[np.float64]) -> Surroundings:
    """The surroundings of a center of mass (3,) in a hull."""
    lengths = kernels.surroundings(hull, center)
    if lengths is not kernels.UNDECIDED:
        return Surroundings(*lengths)
    heights = hull.heights(center)
    lowest = int(np.argmin(heights))
    return Surroundings(
        lowest,
        float(heights[lowest]),
        float(np.abs(hull.vertices - hull.vertices.mean(axis=0)).max()),
        max(float(np.abs(hull.vertices).max()), float(np.abs(center).max())),
        float(np.ptp(hull.vertices, axis=0).max()),
    )


class ExactSigns:
    """Signs for one hull and center of mass. A sign that is exactly zero counts as negative."""

    def __init__(self, hull: ConvexHull, center: NDArray[np.float64]) -> None:
        self._hull = hull
        self._center = center

    @cached_property
    def _radii(self) -> Exact:
        """(n, 3) vertices relative to the center of mass."""
        points = IntegerPoints(np.concatenate([self._hull.vertices, self._center[None]]))[:]
        return points[:-1] - points[-1]

    def growth(self, half_edges: Integers) -> Integers:
        """(k,) 1 where distance from c grows along half-edges (k,) at their starts, else -1."""
        radii = self._radii[self._hull.tail[half_edges]]
        return _signs((radii * self._edges(half_edges)).sum(-1))

    def side(self, half_edges: Integers) -> Integers:
        """(k,) 1 where the foot of c on the facets of half-edges (k,) is inside of these, else
        -1."""
        across = np.cross(self._edges(half_edges), self._normals(self._hull.facet[half_edges]))
        return _signs((self._radii[self._hull.tail[half_edges]] * across).sum(-1))

    def ascend(self, elements: Equilibria, saddle: int, vertex: int) -> tuple[list[int], int]:
        """Half-edges that the flow line from a saddle's half-edge into the cell of one of its ends
        crosses uphill, and the maximum it ends at."""
        v = self._edges(saddle)
        u = _project(self._radii[self._hull.tail[saddle]], v, v)
        crossed = []
        while not elements.maximum[vertex]:
            r = self._radii[vertex]
            edge = self._exit(vertex, _cross(u, r), elements.ascending)
            u = _project(u, r, self._edges(edge))
            crossed.append(edge)
            vertex = int(self._hull.head[edge])
        return crossed, vertex

    def descend(self, elements: Equilibria, facet: int) -> int:
        """Facet that a body slides to, over a hinge edge, which tips from a facet onto a vertex."""
        vertex = int(elements.roll_vertex[facet])
        u = self._normals([facet])[0]
        while True:
            r = self._radii[vertex]
            edge = self._exit(vertex, _cross(r, u), elements.descending)
            u = -_project(u, r, self._edges(edge))
            if elements.hinge[edge]:
                break
            vertex = int(self._hull.head[edge])
        twin = int(self._hull.twin[edge])
        to_left = r @ _cross(self._edges(edge), u) > 0 or elements.side_sign[twin] < 0
        return int(self._hull.facet[edge if to_left and elements.side_sign[edge] > 0 else twin])

    def _exit(self, vertex: int, left_of_travel: Exact, allowed: Booleans) -> int:
        """Half-edge as `exit_half_edges` finds it, for one line."""
        hull = self._hull
        start, order = hull.outgoing
        edges = order[start[vertex] : start[vertex + 1]]
        edges = edges[allowed[edges]]
        twins = hull.twin[edges]
        first = ~allowed[hull.next[twins]]
        last = ~allowed[hull.twin[hull.previous[edges]]]
        right, left = (self._normals(hull.facet[each]) @ left_of_travel for each in (twins, edges))
        # None leaves only around facets that are flat no further than a tolerance: the first then.
        return int(edges[np.argmax((first | (right <= 0)) & (last | (left > 0)))])

    def _edges(self, half_edges: Integers | int) -> Exact:
        """(k, 3) vectors along half-edges (k,)."""
        return self._radii[self._hull.head[half_edges]] - self._radii[self._hull.tail[half_edges]]

    def _normals(self, facets: Iterable[int]) -> Exact:
        """(k, 3) normals of facets (k,), times twice their areas."""
        start, tail = self._hull.facet_start, self._hull.tail
        return np.array([area_vector(self._radii[tail[start[f] : start[f + 1]]]) for f in facets])


def _cross(one: Exact, other: Exact) -> Exact:
    """Cross product of vectors (3,) of whole numbers, which NumPy before 2.2 takes for machine
    integers where they have no second axis."""
    return np.cross(one[None], other[None])[0]


def _signs(values: NDArray[Any]) -> Integers:
    return np.where(values > 0, 1, -1)


def _project(u: Exact, along: Exact, normal: Exact) -> Exact:
    """`geometry.sphere.oblique_projection`, with common factors taken out."""
    moved: Exact = u * (along @ normal) - along * (u @ normal)
    return moved // (gcd(*moved) or 1)


@dataclass(frozen=True)
class Equilibria:
    """A hull with a center of mass, and the classification of its elements.

    Half-edges run from a vertex p (tail) to a vertex q (head); r_p = x_p - c.

    Attributes
    ----------
    hull: the convex hull.
    center_of_mass: (3,).
    tie_distance: length. Where a move of the center of mass by no more than this could change a
        decision, `Tie` is raised instead; 0 for an answer in any case.
    """

    hull: ConvexHull
    center_of_mass: Floats
    tie_distance: float

    @cached_property
    def radii(self) -> Floats:
        """(n, 3) vertices relative to the center of mass, r_p."""
        return self.hull.vertices - self.center_of_mass

    @cached_property
    def exact(self) -> ExactSigns:
        """Answers where rounding leaves a sign open."""
        return ExactSigns(self.hull, self.center_of_mass)

    @cached_property
    def edge_vectors(self) -> Floats:
        """(h, 3) x_q - x_p of each half-edge."""
        return self.hull.vertices[self.hull.head] - self.hull.vertices[self.hull.tail]

    @cached_property
    def edge_lengths(self) -> Floats:
        """(h,) length of each half-edge."""
        return norms(self.edge_vectors)

    @cached_property
    def growth_sign(self) -> Integers:
        """(h,) sign, 1 or -1, of r_p . (x_q - x_p): 1 where distance from c grows at the start."""
        r, v = self.radii[self.hull.tail], self.edge_vectors
        bound = ROUNDING * (np.abs(r) * np.abs(v)).sum(-1)
        return self._certain_signs((r * v).sum(-1), bound, self.exact.growth)

    @cached_property
    def ascending(self) -> Booleans:
        """(h,) whether an ascending path may go from the cell of p to the cell of q."""
        return self.growth_sign > 0

    @cached_property
    def descending(self) -> Booleans:
        """(h,) True where a descending path may leave the cell of p across this edge's arc."""
        return self.growth_sign < 0

    @cached_property
    def hinge(self) -> Booleans:
        """(h,) True for edges whose nearest point to c is strictly inside (E2, section 2.2.2).
        The others are cartwheel edges (E1)."""
        return self.descending & self.descending[self.hull.twin]

    @cached_property
    def side(self) -> Floats:
        """(h,) distance of the foot of c on the facet's plane from the edge's line, negative
        outside, times the edge's length."""
        normals = self.hull.normals[self.hull.facet]
        across = np.linalg.cross(self.edge_vectors, normals)
        return (self.radii[self.hull.tail] * across).sum(-1)

    @cached_property
    def side_sign(self) -> Integers:
        """(h,) sign, 1 or -1, of `side`: 1 where the foot of c is inside of the edge."""
        r, v = np.abs(self.radii[self.hull.tail]), np.abs(self.edge_vectors)
        y, z = np.roll(v, -1, axis=1), np.roll(v, -2, axis=1)
        n = np.abs(self.hull.normals) + self.normal_error[:, None]
        n = n[self.hull.facet]
        across = y * np.roll(n, -2, axis=1) + z * np.roll(n, -1, axis=1)
        spread = (v.sum(-1) * self.normal_error[self.hull.facet])[:, None]
        bound = (r * (ROUNDING * across + 2.0 * spread)).sum(-1)
        return self._certain_signs(self.side, bound, self.exact.side)

    def _certain_signs(
        self, values: Floats, bounds: Floats, exact: Callable[[Integers], Integers]
    ) -> Integers:
        """Signs of values (h,), rounded by up to bounds (h,), that change with c by at most the
        half-edge's length for a unit move."""
        reach = bounds + self.tie_distance * self.edge_lengths
        unsure = np.flatnonzero(np.abs(values) <= reach)
        self.settle(len(unsure) == 0)
        signs = _signs(values)
        if len(unsure):
            signs[unsure] = exact(unsure)
        return signs

    def remember(self, growth_sign: Integers, side_sign: Integers) -> None:
        """Store the signs (h,) of half-edges that a kernel computed."""
        self.__dict__.update(growth_sign=growth_sign, side_sign=side_sign)

    def settle(self, certain: bool) -> None:
        """Raise `Tie` unless certain or the tie distance is 0."""
        if not certain and self.tie_distance > 0.0:
            raise Tie

    @cached_property
    def normal_error(self) -> Floats:
        """(m,) bound on the rounding error of each facet's unit normal, as a length."""
        hull = self.hull
        start = hull.facet_start[:-1]
        anchor = hull.vertices[hull.tail[start]][hull.facet]
        a, b = np.abs(hull.vertices[hull.tail] - anchor), np.abs(hull.vertices[hull.head] - anchor)
        terms = np.roll(a, -1, axis=1) * np.roll(b, -2, axis=1)
        terms += np.roll(a, -2, axis=1) * np.roll(b, -1, axis=1)
        size = np.add.reduceat(terms.sum(-1), start) * (1.0 + np.diff(hull.facet_start))
        return ROUNDING * size / (2.0 * hull.areas)

    @cached_property
    def saddle(self) -> Booleans:
        """(h,) True, for both half-edges, where the edge carries a saddle (section 2.3.3)."""
        inside = self.side_sign > 0
        return self.hinge & inside & inside[self.hull.twin]

    @cached_property
    def saddle_directions(self) -> Floats:
        """(h, 3) direction from c to the nearest point of each edge's line (eq. 7, 8), not
        normalized. Only hinge edges have that point inside the edge."""
        r = self.radii
        return foot_on_line(r[self.hull.tail], r[self.hull.head], self.edge_vectors, np)

    @cached_property
    def maximum(self) -> Booleans:
        """(n,) True for vertices on which the body can balance as on a peak (section 2.3.2)."""
        return np.bincount(self.hull.tail[self.ascending], minlength=len(self.radii)) == 0

    @cached_property
    def stable(self) -> Booleans:
        """(m,) True for facets on which the body rests (F0)."""
        outside = self.hull.facet[self.side_sign < 0]
        return np.bincount(outside, minlength=len(self.hull.normals)) == 0

    @cached_property
    def roll_edge(self) -> Integers:
        """(m,) half-edge that the body on a facet rolls over (F2), or -1."""
        target = np.full(len(self.hull.normals), -1, dtype=np.int64)
        candidates = np.flatnonzero((self.side_sign < 0) & self.hinge)
        length = self.edge_lengths[candidates]
        # One edge faces the foot; of several, which only facets flat within a tolerance can have,
        # the farthest counts.
        order = candidates[np.argsort(-self.side[candidates] / length, kind="stable")]
        target[self.hull.facet[order]] = order
        return target

    @cached_property
    def roll_vertex(self) -> Integers:
        """(m,) vertex that the body on a facet tips onto (F1), or -1."""
        start = self.hull.facet_start[:-1]
        squared = (self.radii[self.hull.tail] ** 2).sum(-1)
        # Distance grows from the nearest one along both sides, which is known exactly.
        is_least = self.ascending & self.ascending[self.hull.twin[self.hull.previous]]
        order = np.lexsort((squared, ~is_least, self.hull.facet))
        nearest = self.hull.tail[order[start]]
        return np.where(self.stable | (self.roll_edge >= 0), -1, nearest)


def classify(hull: ConvexHull, center_of_mass: ArrayLike, tie_distance: float = 0.0) -> Equilibria:
    """Classify the elements of a hull for a center of mass.

    Parameters
    ----------
    hull: the convex hull.
    center_of_mass: (3,) in the hull's length unit, strictly inside the hull.
    tie_distance: see `Equilibria`.

    Raises
    ------
    InputError: the center is not three finite numbers.
    OutsideHullError: the center is on the boundary or outside.
    """
    center = np.require(center_of_mass, np.float64, ["C", "ALIGNED"])
    if center.shape != (3,) or not np.isfinite(center).all():
        raise InputError(f"center of mass: expected three finite numbers, got {center_of_mass!r}")
    place = surroundings(hull, center)
    if place.height <= BOUNDARY_TOLERANCE * place.offset:
        where = (
            f"{-place.height:.3g} outside"
            if place.height < -BOUNDARY_TOLERANCE * place.offset
            else "on the boundary, at"
        )
        raise OutsideHullError(
            f"center of mass: expected a point strictly inside the hull, got "
            f"{center.tolist()}, which is {where} facet {place.facet} of the hull; a body of "
            "nonnegative density has it inside. Give one within the hull or leave it out"
        )
    return Equilibria(hull, center, tie_distance)
