"""Orientations of points in the plane and in space, free of rounding."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.integers import IntegerPoints
from dicedesign.tolerances import ROUNDING

__all__ = ["Orientations"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_UNDERFLOW: Final = 1e-200
"""Products below this may have lost digits to underflow: their signs are found exactly."""


class Orientations:
    """Signs of orientations of points (n, 3).

    What rounding could change is computed again in integers, so the signs never contradict each
    other.
    """

    def __init__(self, points: Floats) -> None:
        self._points = points
        self._integers = IntegerPoints(points)

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
            kept = ((axis + 1) % 3, (axis + 2) % 3)
            corners = tuple(index[chosen] for index in (a, b, c))
            at = [self._points[index][:, kept].T for index in corners]
            value, size = _determinant([corner - at[0] for corner in at[1:]])
            signs[chosen] = self._signs(value, size, corners, kept)
        return signs

    def _signs(
        self, value: Floats, size: Floats, corners: tuple[Integers, ...], kept: tuple[int, ...]
    ) -> Integers:
        signs = np.sign(value).astype(np.int64)
        doubtful = np.flatnonzero(np.abs(value) <= ROUNDING * size + _UNDERFLOW)
        if len(doubtful) > 0:
            at = [self._exact(index[doubtful])[list(kept)] for index in corners]
            exact, _ = _determinant([corner - at[0] for corner in at[1:]])
            signs[doubtful] = (exact > 0).astype(np.int64) - (exact < 0).astype(np.int64)
        return signs

    def _exact(self, index: Integers) -> NDArray[Any]:
        """(3, m) coordinates of points as integers of any size."""
        used, place = np.unique(index, return_inverse=True)
        exact = np.empty((3, len(used)), dtype=object)
        for column, point in enumerate(used.tolist()):
            exact[:, column] = self._integers[point]
        return exact[:, place]


def _determinant(rows: list[NDArray[Any]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Determinants of matrices whose rows are given, each (2, m) or (3, m), and the same sum of
    products with all terms positive."""
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
