"""Plane sections of closed contours by winding number, and sections with strokes that are wide
enough to print.

Contours run either way around: outer ones of TrueType fonts run clockwise, those of other fonts
counter-clockwise, and variable fonts have contours that overlap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
from manifold3d import CrossSection, JoinType

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats

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


MOST_LEVELS: Final = 64
"""Winding numbers that the even-odd rule is applied to."""

MITER: Final = 2.0
"""Corners stay sharp unless they stick out by more, over the distance of the offset."""

CORNERS: Final = 0.1
"""Part of a stroke's width that may stick out of the discs of that width which cover it."""

HALVINGS: Final = 10
"""Of the interval in which the least growth is looked for."""


def non_zero(contours: Sequence[Floats]) -> CrossSection:
    """The points about which contours (n, 2) wind, in either sense."""
    return _above(contours, 0) + _above(_reversed(contours), 0)


def even_odd(contours: Sequence[Floats]) -> CrossSection:
    """The points about which contours (n, 2) wind an odd number of times.

    Raises InputError where they wind more than `MOST_LEVELS` times.
    """
    section = CrossSection()
    for side in (contours, _reversed(contours)):
        level = 0
        while not (above := _above(side, level)).is_empty():
            if level > MOST_LEVELS:
                raise InputError(
                    f"contours: expected at most {MOST_LEVELS} on top of each other, got more; "
                    "simplify the path"
                )
            section += above - _above(side, level + 1)
            level += 2
    return section


def _reversed(contours: Sequence[Floats]) -> list[Floats]:
    return [contour[::-1] for contour in contours]


def _above(contours: Sequence[Floats], level: int) -> CrossSection:
    """The points with a winding number above a level, at least 0."""
    if not contours:
        return CrossSection()
    points = np.concatenate(contours)
    (left, bottom), (right, top) = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    # Each frame, clockwise around them all, takes one off every winding number.
    frame = np.array([(left, bottom), (left, top), (right, top), (right, bottom)])
    return CrossSection([*contours, *[frame] * level])


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
