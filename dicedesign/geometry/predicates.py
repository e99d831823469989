"""Orientations of points in space and in the plane, decided in integers where rounding could change
them.

Coordinates are floats, so a power of two makes integers of them all, and the sign of a polynomial
in them can be computed without rounding."""

from __future__ import annotations

from functools import cached_property
from math import ldexp
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import ROUNDING

Exact: TypeAlias = NDArray[Any]
"""Array of Python integers of any size."""

MANTISSA = 53
"""Binary digits of a float."""

WIDEST = 1000
"""Binary digits, about, of the largest integers that fit in a float."""


class IntegerPoints:
    """Points (n, 3), finite, times one power of two that makes all coordinates integers.

    Indexing converts them: `integers[index]` is an array (..., 3) of Python integers.
    """

    def __init__(self, points: Floats) -> None:
        self._points = points

    def __getitem__(self, index: Any) -> Exact:
        mantissas, exponents = np.frexp(self._points[index])
        digits = np.ldexp(mantissas, MANTISSA).astype(np.int64).astype(object)
        exact: Exact = digits << np.maximum(exponents - self._least, 0).astype(object)
        return exact

    def area_vector(self, polygon: Integers) -> Floats:
        """(3,) normal of a polygon of points (k,), times twice its area, rounded once."""
        exact = area_vector(self[polygon])
        excess = max(max(x.bit_length() for x in exact) - WIDEST, 0)
        exponent = 2 * (self._least - MANTISSA) + excess
        return np.array([ldexp(x / (1 << excess), exponent) for x in exact])

    @cached_property
    def _least(self) -> int:
        exponents = np.frexp(self._points[self._points != 0.0])[1]
        return int(exponents.min()) if len(exponents) else 0


def area_vector(corners: Exact) -> Exact:
    """Normal (3,) of a polygon (k, 3), times twice its area."""
    arms = corners[1:] - corners[0]
    doubled: Exact = np.cross(arms[:-1], arms[1:]).sum(axis=0)
    return doubled


class Orientation:
    """Signs of orientations of points (n, 3), finite.

    The floating-point value decides where it exceeds its rounding error, integer arithmetic
    elsewhere: so the signs never contradict each other.

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
        """Whether three points are on one line."""
        return not area_vector(self.integers[[a, b, other]]).any()

    def in_space(self, point: Integers, a: Integers, b: Integers, c: Integers) -> Integers:
        """(m,) 1 where a point is on the side of a, b, c from which they run counter-clockwise,
        0 where the four are in one plane, else -1; all of them (m,) indices of points."""
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
            at = [self.integers[index[doubtful]].T[list(axes)] for index in corners]
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
