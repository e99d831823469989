"""Floating-point coordinates as integers, and the vector arithmetic of integers.

Coordinates are floats, so a power of two makes integers of them all, and the sign of a polynomial
in them can be had without rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from math import ldexp

import numpy as np

from dicedesign.runtime.arrays import Floats

__all__ = ["IntegerPoints", "Vector", "area_vector", "cross", "dot", "minus"]

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
