"""Curves, bars, bands and notes to be drawn between axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.report.charts.axes import Axes
from dicedesign.report.charts.palette import ACCENT, DARK
from dicedesign.report.charts.paper import NOTE, Paper
from dicedesign.runtime.arrays import Floats

__all__ = ["KEY", "Band", "Bars", "Curve", "Intervals", "Levels", "Note", "Series", "Style"]

KEY: Final = 42.0
"""Width of the samples in a legend, in pixels."""

_CORNERS: Final[dict[str, Sequence[tuple[float, float]]]] = {
    "s": [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
    "D": [(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)],
    "^": [(0.0, -1.15), (1.1, 0.85), (-1.1, 0.85)],
    "v": [(0.0, 1.15), (-1.1, -0.85), (1.1, -0.85)],
    "*": [
        (r * math.sin(math.pi * k / 5.0), -r * math.cos(math.pi * k / 5.0))
        for k, r in enumerate((1.7, 0.68) * 5)
    ],
}
"""Of markers, in units of their size, y downward."""


@dataclass(frozen=True)
class Style:
    """Look of a curve.

    Attributes
    ----------
    color: of its line and its markers.
    line: whole, dashed, or none. width: of the line in pixels.
    marker: "o", "s", "D", "^", "v", "*", "x", or none. size: half its width in pixels.
    filled: whether markers are; others are white inside.
    edge: colour of the border of markers; empty as the curve.
    """

    color: str = ACCENT
    line: Literal["-", "--", ""] = "-"
    width: float = 3.0
    marker: str = ""
    size: float = 5.0
    filled: bool = True
    edge: str = ""

    def trace(self, paper: Paper, path: Floats) -> None:
        """Draw the line along a path (n, 2) on paper."""
        if self.line:
            paper.line(path, self.color, self.width, dashed=self.line == "--")

    def mark(self, paper: Paper, places: Floats) -> None:
        """Draw the markers at places (n, 2) on paper."""
        edge, inside = self.edge or self.color, self.color if self.filled else "white"
        for place in places:
            if self.marker == "o":
                paper.disc(place, self.size, inside, edge, 0.0 if self.filled else 2.0)
            elif self.marker == "x":
                for turn in (1.0, -1.0):
                    arm = self.size * np.array([1.0, turn])
                    paper.line([place - arm, place + arm], self.color, 3.0)
            elif self.marker:
                corners = np.asarray(_CORNERS[self.marker])
                paper.polygon(place + (self.size + 1.0) * corners, edge)
                if not self.filled or self.edge:
                    paper.polygon(place + (self.size - 1.4) * corners, inside)


class Series(Protocol):
    """Something drawn between axes.

    Attributes
    ----------
    label: of its entry in the legend; empty for none.
    """

    @property
    def label(self) -> str: ...

    def draw(self, paper: Paper, axes: Axes) -> None:
        """Draw it between axes."""

    def key(self, paper: Paper, left: float, middle: float) -> None:
        """Draw its sample for a legend."""


@dataclass(frozen=True)
class Curve:
    """Values y (n,) at x (n,), joined by lines, perhaps in steps that keep a value until the next
    x."""

    x: ArrayLike
    y: ArrayLike
    style: Style = Style()
    label: str = ""
    steps: bool = False

    def draw(self, paper: Paper, axes: Axes) -> None:
        path = places = axes.places(self.x, self.y)
        if self.steps:
            path = places.repeat(2, axis=0)[:-1]
            path[1::2, 0] = places[1:, 0]
        self.style.trace(paper, path)
        self.style.mark(paper, places)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        ends = np.array([[left, middle], [left + KEY, middle]])
        self.style.trace(paper, ends)
        self.style.mark(paper, ends.mean(axis=0, keepdims=True))


@dataclass(frozen=True)
class Bars:
    """Upright bars from the lower border to heights (n,), as wide as `width` around x (n,)."""

    x: ArrayLike
    heights: ArrayLike
    width: float
    color: str
    label: str = ""
    alpha: float = 1.0

    def draw(self, paper: Paper, axes: Axes) -> None:
        x = np.asarray(self.x, dtype=np.float64)
        left, top = axes.places(x - self.width / 2.0, self.heights).T
        right, _ = axes.places(x + self.width / 2.0, self.heights).T
        for bar in zip(left, top, right, strict=True):
            paper.box(*bar, axes.box[3], self.color, self.alpha)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        paper.box(left, middle - 7.0, left + KEY, middle + 7.0, self.color, self.alpha)


@dataclass(frozen=True)
class Band:
    """What lies between two values of x, from the lower border to the upper one."""

    left: float
    right: float
    color: str
    label: str = ""
    alpha: float = 0.35

    def draw(self, paper: Paper, axes: Axes) -> None:
        (left, right) = axes.places([self.left, self.right], [axes.y.low] * 2)[:, 0]
        paper.box(left, axes.box[1], right, axes.box[3], self.color, self.alpha)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        paper.box(left, middle - 9.0, left + KEY, middle + 9.0, self.color, self.alpha)


@dataclass(frozen=True)
class Levels:
    """Level lines at heights y (n,), as long as `width` around x (n,)."""

    x: ArrayLike
    y: ArrayLike
    width: float
    style: Style = Style(DARK)
    label: str = ""

    def draw(self, paper: Paper, axes: Axes) -> None:
        x = np.asarray(self.x, dtype=np.float64)
        starts = axes.places(x - self.width / 2.0, self.y)
        ends = axes.places(x + self.width / 2.0, self.y)
        for line in np.stack([starts, ends], axis=1):
            self.style.trace(paper, line)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        self.style.trace(paper, np.array([[left, middle], [left + KEY, middle]]))


@dataclass(frozen=True)
class Intervals:
    """Upright lines with a bar at either end from `low` (n,) to `high` (n,) at x (n,)."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    label: str = ""
    color: str = DARK
    cap: float = 6.0
    """Half the length of the bars in pixels."""

    def draw(self, paper: Paper, axes: Axes) -> None:
        lower, upper = axes.places(self.x, self.low), axes.places(self.x, self.high)
        for ends in np.stack([lower, upper], axis=1):
            self._draw(paper, ends)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        x = left + KEY / 2.0
        self._draw(paper, np.array([[x, middle + 11.0], [x, middle - 11.0]]))

    def _draw(self, paper: Paper, ends: Floats) -> None:
        arm = np.array([self.cap, 0.0])
        paper.line(ends, self.color, 2.0)
        for end in ends:
            paper.line([end - arm, end + arm], self.color, 2.0)


@dataclass(frozen=True)
class Note:
    """A text at a value of y, and at a value of x or, where `inside`, at a share of the width;
    moved by an offset in pixels."""

    text: str
    x: float
    y: float
    offset: tuple[float, float] = (0.0, 0.0)
    anchor: str = "mm"
    size: int = NOTE
    color: str = DARK
    turned: bool = False
    inside: bool = False

    def draw(self, paper: Paper, axes: Axes) -> None:
        """Write it between axes."""
        place = axes.places([axes.x.low if self.inside else self.x], [self.y])[0] + self.offset
        if self.inside:
            place[0] += self.x * (axes.box[2] - axes.box[0])
        paper.text(
            self.text,
            place,
            size=self.size,
            anchor=self.anchor,
            color=self.color,
            turned=self.turned,
        )
