"""On which side of a plane through three points a fourth one lies, decided exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.integers import IntegerPoints, cross, dot, minus
from dicedesign.tolerances import ROUNDING

__all__ = ["Orientation"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Orientation:
    """Exact sides of planes through points (n, 3), finite.

    The value in floating point decides where it exceeds a bound of its rounding error, arithmetic
    in integers elsewhere.
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
        corners = self._points[triangles]
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        c = self._points[others] - corners[:, 0]
        left, right = np.roll(a, -1, axis=1), np.roll(b, -2, axis=1)
        low, high = np.roll(a, -2, axis=1), np.roll(b, -1, axis=1)
        first, second = left * right, low * high
        values = (c * (first - second)).sum(-1)
        bounds = ROUNDING * (np.abs(c) * (np.abs(first) + np.abs(second))).sum(-1)
        # Products that underflow are wrong by less than any normal number.
        unsure = np.flatnonzero(np.abs(values) <= bounds + np.finfo(np.float64).tiny)
        found = np.sign(values).astype(np.int64)
        for k in unsure:
            found[k] = self._exact(triangles[k].tolist(), int(others[k]))
        return found

    def _exact(self, triangle: list[int], other: int) -> int:
        a, b, c = triangle
        origin = self.integers[a]
        normal = cross(minus(self.integers[b], origin), minus(self.integers[c], origin))
        value = dot(normal, minus(self.integers[other], origin))
        return (value > 0) - (value < 0)

    def collinear(self, a: int, b: int, other: int) -> bool:
        """Whether three points lie on one line."""
        origin = self.integers[a]
        along = minus(self.integers[b], origin)
        return cross(along, minus(self.integers[other], origin)) == (0, 0, 0)
