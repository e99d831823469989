"""Charts: curves, bars and bands between two axes, with ticks, titles and a legend."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.report.charts.palette import ACCENT, DARK, GRID
from dicedesign.report.charts.paper import BODY, NOTE, SMALL, TINY, TITLE, Paper, text_width
from dicedesign.runtime.arrays import Floats

__all__ = [
    "Axis",
    "Band",
    "Bars",
    "Chart",
    "Curve",
    "Intervals",
    "Levels",
    "Note",
    "Series",
    "Style",
    "draw_legend",
    "legend_height",
    "legend_width",
    "sheet",
]

_TICK: Final = 7.0
_KEY: Final = 42.0
"""Width of the samples in a legend."""

_KEY_GAP: Final = 12.0
_ENTRY_GAP: Final = 34.0
_ROW: Final = 36.0
"""Height of each row of a legend."""

_MOST_TICKS: Final = 9

_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

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


@dataclass(frozen=True)
class Axis:
    """One axis of a chart.

    Attributes
    ----------
    low, high: values at its ends, low below high; both above 0 on a logarithmic one.
    label: beside it.
    log: whether it is logarithmic.
    ticks: places and texts, or None for round values.
    shown: whether ticks have texts.
    zero: whether values of zero are drawn at the lower end of a logarithmic axis, marked 0.
    """

    low: float
    high: float
    label: str = ""
    log: bool = False
    ticks: Sequence[tuple[float, str]] | None = None
    shown: bool = True
    zero: bool = False

    def shares(self, values: ArrayLike) -> Floats:
        """Where values (n,) are along it, from 0 to 1."""
        places, low, high = np.asarray(values, dtype=np.float64), self.low, self.high
        if self.log:
            places, low, high = np.log10(places), math.log10(low), math.log10(high)
        return np.asarray((places - low) / (high - low))

    def marks(self) -> list[tuple[float, str]]:
        """Places and texts of its ticks."""
        if self.ticks is not None:
            return list(self.ticks)
        marks = _decades(self.low, self.high) if self.log else _round_values(self.low, self.high)
        return [(self.low, "0"), *marks] if self.zero else marks


def _decades(low: float, high: float) -> list[tuple[float, str]]:
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    step = -(-(last - first + 1) // _MOST_TICKS)
    powers = [power for power in range(first, last + 1) if power % step == 0]
    return [(10.0**power, "10" + str(power).translate(_RAISED)) for power in powers]


def _round_values(low: float, high: float) -> list[tuple[float, str]]:
    rough = (high - low) / _MOST_TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(step * power for step in (1.0, 2.0, 2.5, 5.0, 10.0) if step * power >= rough)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    decimals += round(step * 10.0**decimals, 6) % 1.0 > 0.0
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = [number * step for number in range(first, last + 1)]
    return [(value, f"{value:,.{decimals}f}") for value in values]


class Series(Protocol):
    """Something drawn in a chart.

    Attributes
    ----------
    label: of its entry in the legend; empty for none.
    """

    @property
    def label(self) -> str: ...

    def draw(self, paper: Paper, chart: Chart) -> None:
        """Draw it in a chart."""

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

    def draw(self, paper: Paper, chart: Chart) -> None:
        path = places = chart.places(self.x, self.y)
        if self.steps:
            path = places.repeat(2, axis=0)[:-1]
            path[1::2, 0] = places[1:, 0]
        self.style.trace(paper, path)
        self.style.mark(paper, places)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        ends = np.array([[left, middle], [left + _KEY, middle]])
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

    def draw(self, paper: Paper, chart: Chart) -> None:
        x = np.asarray(self.x, dtype=np.float64)
        left, top = chart.places(x - self.width / 2.0, self.heights).T
        right, _ = chart.places(x + self.width / 2.0, self.heights).T
        for bar in zip(left, top, right, strict=True):
            paper.box(*bar, chart.box[3], self.color, self.alpha)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        paper.box(left, middle - 7.0, left + _KEY, middle + 7.0, self.color, self.alpha)


@dataclass(frozen=True)
class Band:
    """What lies between two values of x, from the lower border to the upper one."""

    left: float
    right: float
    color: str
    label: str = ""
    alpha: float = 0.35

    def draw(self, paper: Paper, chart: Chart) -> None:
        (left, right) = chart.places([self.left, self.right], [chart.y.low] * 2)[:, 0]
        paper.box(left, chart.box[1], right, chart.box[3], self.color, self.alpha)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        paper.box(left, middle - 9.0, left + _KEY, middle + 9.0, self.color, self.alpha)


@dataclass(frozen=True)
class Levels:
    """Level lines at heights y (n,), as long as `width` around x (n,)."""

    x: ArrayLike
    y: ArrayLike
    width: float
    style: Style = Style(DARK)
    label: str = ""

    def draw(self, paper: Paper, chart: Chart) -> None:
        x = np.asarray(self.x, dtype=np.float64)
        starts = chart.places(x - self.width / 2.0, self.y)
        ends = chart.places(x + self.width / 2.0, self.y)
        for line in np.stack([starts, ends], axis=1):
            self.style.trace(paper, line)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        self.style.trace(paper, np.array([[left, middle], [left + _KEY, middle]]))


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

    def draw(self, paper: Paper, chart: Chart) -> None:
        lower, upper = chart.places(self.x, self.low), chart.places(self.x, self.high)
        for ends in np.stack([lower, upper], axis=1):
            self._draw(paper, ends)

    def key(self, paper: Paper, left: float, middle: float) -> None:
        x = left + _KEY / 2.0
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

    def draw(self, paper: Paper, chart: Chart) -> None:
        """Write it in a chart."""
        place = chart.places([chart.x.low if self.inside else self.x], [self.y])[0] + self.offset
        if self.inside:
            place[0] += self.x * (chart.box[2] - chart.box[0])
        paper.text(
            self.text,
            place,
            size=self.size,
            anchor=self.anchor,
            color=self.color,
            turned=self.turned,
        )


@dataclass
class Chart:
    """What is drawn between two axes.

    Attributes
    ----------
    box: left, top, right and lower border of the place between the axes, in pixels.
    x, y: the axes.
    series: earlier ones lie below later ones.
    title: above, in the middle. notes: texts above all series.
    grid: of which axes ticks have lines across the chart.
    legend: columns of the legend between title and box, or 0 for none.
    """

    box: tuple[float, float, float, float]
    x: Axis
    y: Axis
    series: list[Series] = field(default_factory=list)
    title: str = ""
    notes: list[Note] = field(default_factory=list)
    grid: Literal["", "x", "y", "xy"] = "xy"
    legend: int = 0

    def places(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Places (n, 2) on paper of values x (n,) and y (n,)."""
        left, top, right, bottom = self.box
        columns = left + self.x.shares(x) * (right - left)
        rows = bottom - self.y.shares(y) * (bottom - top)
        return np.stack(np.broadcast_arrays(columns, rows), axis=-1)

    def draw(self, paper: Paper) -> None:
        """Draw everything."""
        left, top, right, bottom = self.box
        columns = left + self.x.shares([place for place, _ in self.x.marks()]) * (right - left)
        rows = bottom - self.y.shares([place for place, _ in self.y.marks()]) * (bottom - top)
        for x in columns if "x" in self.grid else ():
            paper.line([(x, top), (x, bottom)], GRID, 1.0)
        for y in rows if "y" in self.grid else ():
            paper.line([(left, y), (right, y)], GRID, 1.0)
        for series in self.series:
            series.draw(paper, self)
        paper.line([(left, top), (left, bottom), (right, bottom)], DARK, 2.0)
        self._write_ticks(paper, columns, rows)
        if self.legend:
            top -= legend_height(self.series, self.legend) + 6.0
            draw_legend(paper, self.series, (right, top), columns=self.legend, align="right")
        if self.title:
            paper.text(self.title, ((left + right) / 2.0, top - 12.0), size=TITLE, anchor="md")
        for note in self.notes:
            note.draw(paper, self)

    def _write_ticks(self, paper: Paper, columns: Floats, rows: Floats) -> None:
        left, _, right, bottom = self.box
        texts = [text for _, text in self.x.marks()]
        room = (columns[1] - columns[0]) if len(columns) > 1 else right - left
        size = next((s for s in (SMALL, TINY) if _widest(texts, s) < room - 6.0), TINY)
        turned = _widest(texts, size) > room - 6.0
        for x, text in zip(columns, texts, strict=True):
            paper.line([(x, bottom), (x, bottom + _TICK)], DARK, 2.0)
            if self.x.shown and turned:
                paper.text(text, (x, bottom + 12.0), size=size, anchor="rm", turned=True)
            elif self.x.shown:
                paper.text(text, (x, bottom + 12.0), size=size, anchor="ma")
        texts = [text for _, text in self.y.marks()]
        for y, text in zip(rows, texts, strict=True):
            paper.line([(left - _TICK, y), (left, y)], DARK, 2.0)
            if self.y.shown:
                paper.text(text, (left - 12.0, y), size=SMALL, anchor="rm")
        if self.x.label:
            below = _widest([text for _, text in self.x.marks()], size) if turned else 24.0
            place = (left + right) / 2.0, bottom + (below if self.x.shown else 0.0) + 18.0
            paper.text(self.x.label, place, size=BODY, anchor="ma")
        if self.y.label:
            beside = _widest(texts, SMALL) if self.y.shown else 0.0
            place = left - beside - 34.0, (self.box[1] + bottom) / 2.0
            paper.text(self.y.label, place, size=BODY, turned=True)


def sheet(charts: Sequence[Chart], below: float = 95.0) -> Paper:
    """Charts on one sheet that ends `below` pixels below the lowest."""
    paper = Paper(
        max(chart.box[2] for chart in charts) + 25.0, max(chart.box[3] for chart in charts) + below
    )
    for chart in charts:
        chart.draw(paper)
    return paper


def _widest(texts: Iterable[str], size: int) -> float:
    return max((text_width(text, size) for text in texts), default=0.0)


def draw_legend(
    paper: Paper,
    series: Iterable[Series],
    place: tuple[float, float],
    *,
    columns: int = 99,
    align: Literal["left", "middle", "right"] = "middle",
    size: int = SMALL,
) -> None:
    """Samples and labels of series, each label once, in rows of at most `columns`.

    place: (2,) of the upper end of the legend: its left end, middle or right end.
    """
    entries = _labelled(series)
    widths = _column_widths(entries, columns, size)
    start = place[0] - _total(widths) * {"left": 0.0, "middle": 0.5, "right": 1.0}[align]
    for number, entry in enumerate(entries):
        row, column = divmod(number, len(widths))
        left = start + sum(widths[:column]) + column * _ENTRY_GAP
        middle = place[1] + (row + 0.5) * _ROW
        entry.key(paper, left, middle)
        paper.text(entry.label, (left + _KEY + _KEY_GAP, middle), size=size, anchor="lm")


def legend_height(series: Iterable[Series], columns: int) -> float:
    """Pixels that a legend of series is tall."""
    return _ROW * -(-len(_labelled(series)) // columns)


def legend_width(series: Iterable[Series], columns: int, size: int = SMALL) -> float:
    """Pixels that a legend of series is wide."""
    return _total(_column_widths(_labelled(series), columns, size))


def _labelled(series: Iterable[Series]) -> list[Series]:
    return list({one.label: one for one in series if one.label}.values())


def _column_widths(entries: Sequence[Series], columns: int, size: int) -> list[float]:
    columns = min(columns, len(entries))
    return [
        _KEY + _KEY_GAP + _widest([one.label for one in entries[k::columns]], size)
        for k in range(columns)
    ]


def _total(widths: Sequence[float]) -> float:
    return sum(widths) + max(len(widths) - 1, 0) * _ENTRY_GAP
