"""Outlines of curves as polylines, and plane sections with strokes that are wide enough to
print."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
from manifold3d import CrossSection, JoinType

from dicedesign.runtime.arrays import Floats

CHORD_TOLERANCE: Final = 1e-3
"""Largest distance between a curve and the polyline drawn for it, in digit heights."""

MOST_PIECES: Final = 10_000
"""Of the polyline of a curve."""

_Point: TypeAlias = tuple[float, float]


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
        degree = len(corners) - 1
        bends = corners[:-2] - 2.0 * corners[1:-1] + corners[2:]
        # A curve cut at n equal parameters leaves its chords by |second derivative| / 8n^2 at most.
        turn = degree * (degree - 1) * float(np.linalg.norm(bends, axis=1).max(initial=0.0))
        pieces = min(max(1, math.ceil(math.sqrt(turn / (8.0 * self.tolerance)))), MOST_PIECES)
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


MITER: Final = 2.0
"""Corners stay sharp unless they stick out by more, over the distance of the offset."""

CORNERS: Final = 0.1
"""Part of a stroke's width that may stick out of the discs of that width which cover it."""

HALVINGS: Final = 10
"""Of the interval in which the least growth is looked for."""


def holes_and_parts(section: CrossSection) -> tuple[int, int]:
    """Number of holes in a section and of pieces that it falls into."""
    parts = len(section.decompose())
    return section.num_contour() - parts, parts


def stroke_growth(section: CrossSection, width: float) -> float:
    """The least distance by which the outlines of a section move outward so that its strokes are as
    wide as `width`, in its unit; 0 where they are.

    A stroke is as wide where discs of that diameter in the grown section cover it, but for corners.
    """
    if width <= 0.0 or _covered(section, section, width):
        return 0.0
    low, high = 0.0, 0.5 * width
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if _covered(section, grown(section, middle), width):
            high = middle
        else:
            low = middle
    return high


def grown(section: CrossSection, distance: float) -> CrossSection:
    """A section with outlines moved outward by a distance, at least 0; corners stay sharp."""
    if distance == 0.0:
        return section
    return section.offset(distance, JoinType.Miter, MITER)


def _covered(section: CrossSection, whole: CrossSection, width: float) -> bool:
    opened = grown(whole.offset(-0.5 * width, JoinType.Miter, MITER), 0.5 * width)
    left = section - opened
    if left.is_empty():
        return True
    # Corners are narrow, and near what the discs cover; hairlines lead away from it.
    is_narrow = left.offset(-0.5 * CORNERS * width, JoinType.Miter, MITER).is_empty()
    return is_narrow and (left - grown(opened, width)).is_empty()
