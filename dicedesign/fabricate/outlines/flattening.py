"""Outlines made of lines and curves as polylines."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np

from dicedesign.runtime.arrays import Floats

__all__ = ["CHORD_TOLERANCE", "PolylinePen", "pieces_of"]

CHORD_TOLERANCE: Final = 1e-3
"""Largest distance between a curve and the polyline drawn for it, in digit heights."""

_Point: TypeAlias = tuple[float, float]


def pieces_of(corners: Floats, tolerance: float) -> int:
    """Number of chords, at equal parameters, that a curve of Bezier with control points (n, 2), n
    from 2 to 4, is drawn with for a tolerance, above 0."""
    degree = len(corners) - 1
    bends = corners[:-2] - 2.0 * corners[1:-1] + corners[2:]
    # A curve cut at n equal parameters leaves its chords by |second derivative| / 8n^2 at most.
    turn = degree * (degree - 1) * float(np.linalg.norm(bends, axis=1).max(initial=0.0))
    return max(1, math.ceil(math.sqrt(turn / (8.0 * tolerance))))


class PolylinePen:
    """Collects contours as lists of points, with quadratic and cubic curves flattened.

    It has the methods that fontTools and HarfBuzz draw outlines with.

    tolerance: largest distance between a curve and its polyline, above 0, in the unit of the
    points.
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self._contours: list[list[_Point]] = []

    def moveTo(self, point: _Point) -> None:
        """Begin a contour."""
        self._contours.append([point])

    def lineTo(self, point: _Point) -> None:
        """Go straight to a point."""
        self._contours[-1].append(point)

    def qCurveTo(self, control: _Point, end: _Point) -> None:
        """Go along a parabola to a point."""
        self._bend(np.array([self._contours[-1][-1], control, end], dtype=np.float64))

    def curveTo(self, first: _Point, second: _Point, end: _Point) -> None:
        """Go along a cubic curve to a point."""
        self._bend(np.array([self._contours[-1][-1], first, second, end], dtype=np.float64))

    def closePath(self) -> None:
        """All contours are closed anyway."""

    def endPath(self) -> None:
        """All contours are closed anyway."""

    def _bend(self, corners: Floats) -> None:
        pieces = pieces_of(corners, self.tolerance)
        t = (np.arange(1, pieces) / pieces)[:, None]
        points: list[Floats] = [np.broadcast_to(corner, (len(t), 2)) for corner in corners]
        while len(points) > 1:  # de Casteljau
            points = [(1.0 - t) * a + t * b for a, b in pairwise(points)]
        self._contours[-1] += [(float(x), float(y)) for x, y in points[0]]
        self._contours[-1].append((float(corners[-1, 0]), float(corners[-1, 1])))

    def contours(self) -> list[Floats]:
        """The contours (n, 2) so far, n at least 3, without a repeated last point."""
        found = []
        for points in self._contours:
            if points[0] == points[-1]:
                points = points[:-1]
            if len(points) > 2:  # lone points and lines bound nothing
                found.append(np.array(points, dtype=np.float64))
        return found
