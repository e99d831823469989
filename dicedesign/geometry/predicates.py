"""Orientations of points in space and in the plane, decided in integers where rounding could change
them.

Coordinates are floats, so a power of two makes integers of them all, and the sign of a polynomial
in them can be had without rounding."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from math import ldexp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import ROUNDING

Vector = tuple[int, int, int]

MANTISSA = 53
"""Binary digits of a float."""

WIDEST = 1000
"""Binary digits of an integer, about, up to which it fits in a float."""


class IntegerPoints:
    """Points (n, 3), finite, times one power of two that makes all coordinates integers.

    They are converted when they are asked for: `integers[i]` is point i.
    """

    def __init__(self, points: Floats) -> None:
        self._points = points
        self._known: dict[int, Vector] = {}

    def __getitem__(self, index: int) -> Vector:
        if index not in self._known:
            mantissas, exponents = np.frexp(self._points[index])
            x, y, z = (
                int(m * 2.0**MANTISSA) << max(int(e) - self._least, 0)
                for m, e in zip(mantissas, exponents, strict=True)
            )
            self._known[index] = x, y, z
        return self._known[index]

    def area_vector(self, polygon: Sequence[int]) -> Floats:
        """(3,) normal of a polygon of points, times twice its area, rounded once."""
        exact = area_vector([self[int(corner)] for corner in polygon])
        excess = max(max(x.bit_length() for x in exact) - WIDEST, 0)
        exponent = 2 * (self._least - MANTISSA) + excess
        return np.array([ldexp(x / (1 << excess), exponent) for x in exact])

    @cached_property
    def _least(self) -> int:
        exponents = np.frexp(self._points[self._points != 0.0])[1]
        return int(exponents.min()) if len(exponents) else 0


def dot(a: Vector, b: Vector) -> int:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def minus(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def area_vector(corners: Sequence[Vector]) -> Vector:
    """Normal of a polygon, times twice its area."""
    total = (0, 0, 0)
    for a, b in pairwise(corners[1:]):
        turn = cross(minus(a, corners[0]), minus(b, corners[0]))
        total = (total[0] + turn[0], total[1] + turn[1], total[2] + turn[2])
    return total


class Orientation:
    """Signs of orientations of points (n, 3), finite.

    The value in floating point decides where it exceeds a bound of its rounding error, arithmetic
    in integers elsewhere: so the signs never contradict each other.

    Attributes
    ----------
    integers: the points, times a power of two.
    """

    def __init__(self, points: Floats) -> None:
        exponent = int(np.frexp(np.abs(points).max())[1])
        self._points = np.ldexp(points, -exponent)
        self.integers = IntegerPoints(points)

    def signs(self, triangles: Integers, others: Integers) -> Integers:
        """1, 0 or -1 (k,) for a point above, on or below the plane of a triangle that runs
        counter-clockwise seen from above.

        triangles: (k, 3) and others: (k,) indices of points.
        """
        return self.in_space(others, *triangles.T)

    def collinear(self, a: int, b: int, other: int) -> bool:
        """True if three points lie on one line."""
        origin = self.integers[a]
        along = minus(self.integers[b], origin)
        return cross(along, minus(self.integers[other], origin)) == (0, 0, 0)

    def in_space(self, point: Integers, a: Integers, b: Integers, c: Integers) -> Integers:
        """(m,) 1 where a point lies on the side of a, b, c from which they run counter-clockwise,
        0 where the four lie in one plane, else -1; all of them (m,) indices of points."""
        corners = [self._points[index] for index in (a, b, c, point)]
        value, size = _determinant([corner.T - corners[0].T for corner in corners[1:]])
        return self._signs(value, size, (a, b, c, point), (0, 1, 2))

    def in_plane(self, dropped: Integers, a: Integers, b: Integers, c: Integers) -> Integers:
        """(m,) 1 where points a, b, c run counter-clockwise in the coordinates that follow the
        dropped one in cyclic order, 0 where they lie on one line, else -1; dropped: (m,) indices of
        coordinates, a to c: of points."""
        signs = np.zeros(len(a), dtype=np.int64)
        for axis in range(3):
            chosen = np.flatnonzero(dropped == axis)
            axes = ((axis + 1) % 3, (axis + 2) % 3)
            corners = tuple(index[chosen] for index in (a, b, c))
            at = [self._points[index][:, axes].T for index in corners]
            value, size = _determinant([corner - at[0] for corner in at[1:]])
            signs[chosen] = self._signs(value, size, corners, axes)
        return signs

    def _signs(
        self, value: Floats, size: Floats, corners: tuple[Integers, ...], axes: tuple[int, ...]
    ) -> Integers:
        signs = np.sign(value).astype(np.int64)
        # Products that underflow are wrong by less than any normal number.
        doubtful = np.flatnonzero(np.abs(value) <= ROUNDING * size + np.finfo(np.float64).tiny)
        if len(doubtful) > 0:
            # Coordinates (2 or 3, m) as integers of any size.
            at = []
            for index in corners:
                used, place = np.unique(index[doubtful], return_inverse=True)
                exact = np.array([self.integers[i] for i in used.tolist()], dtype=object)
                at.append(exact.T[list(axes)][:, place])
            exact, _ = _determinant([corner - at[0] for corner in at[1:]])
            signs[doubtful] = (exact > 0).astype(np.int64) - (exact < 0).astype(np.int64)
        return signs


def _determinant(rows: list[NDArray[Any]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Determinants of matrices given by rows, each (2, m) or (3, m), and the sum of absolute
    products."""
    if len(rows) == 2:
        (a, b), (c, d) = rows
        return a * d - b * c, abs(a * d) + abs(b * c)
    terms, bounds = [], []
    for axis in range(3):
        left, right = (axis + 1) % 3, (axis + 2) % 3
        minor, bound = _determinant([row[[left, right]] for row in rows[1:]])
        terms.append(rows[0][axis] * minor)
        bounds.append(abs(rows[0][axis]) * bound)
    return terms[0] + terms[1] + terms[2], bounds[0] + bounds[1] + bounds[2]
