"""Charts with ticks, titles and legends, on sheets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

from dicedesign.report.charts.axes import Axes
from dicedesign.report.charts.palette import DARK, GRID
from dicedesign.report.charts.paper import BODY, SMALL, TINY, TITLE, Paper, text_width
from dicedesign.report.charts.series import KEY, Note, Series
from dicedesign.runtime.arrays import Floats

__all__ = ["Chart", "draw_legend", "legend_height", "legend_width", "sheet"]

_TICK: Final = 7.0

_KEY_GAP: Final = 12.0

_ENTRY_GAP: Final = 34.0

_ROW: Final = 36.0
"""Height of each row of a legend."""


@dataclass
class Chart(Axes):
    """What is drawn between two axes.

    Attributes
    ----------
    series: earlier ones lie below later ones.
    title: above, in the middle. notes: texts above all series.
    grid: of which axes ticks have lines across the chart.
    legend: columns of the legend between title and box, or 0 for none.
    """

    series: list[Series] = field(default_factory=list)
    title: str = ""
    notes: list[Note] = field(default_factory=list)
    grid: Literal["", "x", "y", "xy"] = "xy"
    legend: int = 0

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
        max(chart.box[2] for chart in charts) + 40.0, max(chart.box[3] for chart in charts) + below
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
        paper.text(entry.label, (left + KEY + _KEY_GAP, middle), size=size, anchor="lm")


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
        KEY + _KEY_GAP + _widest([one.label for one in entries[k::columns]], size)
        for k in range(columns)
    ]


def _total(widths: Sequence[float]) -> float:
    return sum(widths) + max(len(widths) - 1, 0) * _ENTRY_GAP
