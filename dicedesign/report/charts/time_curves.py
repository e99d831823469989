"""Curves of several methods on logarithmic axes, in panels with one legend."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, draw_legend, legend_height
from dicedesign.report.charts.palette import DARK, DISTINCT, FAINT, repeated
from dicedesign.report.charts.paper import NOTE, Paper
from dicedesign.report.charts.series import Curve, Note, Style
from dicedesign.runtime.arrays import Floats

__all__ = [
    "DesignCurve",
    "DesignPanel",
    "Panel",
    "design_methods_figure",
    "panels_figure",
    "time_against_size_figure",
]

_WIDTHS: Final = (840.0, 1200.0, 1500.0)
"""Pixels of a figure with one, two, and three or more panels side by side."""

_TALL: Final = 410.0
"""Pixels of the place between axes."""

_GAP: Final = 60.0
"""Pixels between panels, for a title or the texts of an axis."""

_FIRST: Final = 1e-3
"""Seconds at which the time axis of designs begins."""

_DECADES: Final = 16
"""Values this many powers of ten below the largest of a panel are drawn on its lower border."""

_ZERO: Final = "border: 0"

_LEVEL: Final = Style(FAINT, "--", 2.0)


@dataclass(frozen=True)
class Panel:
    """One chart of several.

    Attributes
    ----------
    title: above it.
    curves: of positive x and of y at least 0; zeros are drawn at the lower border, which says so.
        Earlier ones are drawn above later ones; those of one label should look alike in all panels.
    levels: names and values, above 0, of dashed lines across it.
    y_label: what its vertical axis is called.
    """

    title: str
    curves: Sequence[Curve]
    levels: Mapping[str, float] = field(default_factory=dict)
    y_label: str = "error, max |p − q|"


def panels_figure(
    panels: Sequence[Panel],
    columns: int,
    *,
    x_label: str = "run time (s)",
    same_heights: bool = True,
    keys: Iterable[Curve] = (),
    note: str = "",
) -> Paper:
    """Panels side by side in rows.

    Parameters
    ----------
    panels: at least one, each with at least one point.
    columns: panels in a row, at least 1.
    same_heights: whether all have the vertical axis of the first; otherwise each has its own.
    keys: entries of the legend below beside those of the curves.
    note: small print at the foot, such as the machine and the date.

    Raises
    ------
    InputError: there is nothing to draw, or a value does not fit a logarithmic axis.
    """
    points = [_points(panel.curves) for panel in panels]
    _check(points)
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    width = _WIDTHS[min(columns, len(_WIDTHS)) - 1] if same_heights else _WIDTHS[-1]
    room = 40.0 if same_heights else 125.0
    wide = (width - 140.0 - 25.0 - (columns - 1) * room) / columns
    everything = np.concatenate(points)
    x = Axis(everything[:, 0].min() / 1.8, everything[:, 0].max() * 1.8, x_label, log=True)
    shared = _heights(everything[:, 1], [v for panel in panels for v in panel.levels.values()])
    entries = [*(curve for panel in panels for curve in panel.curves), *keys]
    in_row = columns + 1
    below = 95.0 + legend_height(entries, in_row) + (34.0 if note else 0.0)
    paper = Paper(width, 55.0 + rows * _TALL + (rows - 1) * _GAP + below)
    for place, (panel, own) in enumerate(zip(panels, points, strict=True)):
        row, column = divmod(place, columns)
        left, top = 140.0 + column * (wide + room), 55.0 + row * (_TALL + _GAP)
        y = shared if same_heights else _heights(own[:, 1], list(panel.levels.values()))
        first, last = column == 0 or not same_heights, place + columns >= len(panels)
        chart = Chart(
            (left, top, left + wide, top + _TALL),
            replace(x, shown=last, label=x_label if last else ""),
            replace(y, shown=first, label=panel.y_label if first else ""),
            title=panel.title,
        )
        for name, level in panel.levels.items():
            chart.series.append(Curve([x.low, x.high], [level, level], _LEVEL))
            if place == 0:
                chart.notes.append(
                    Note(name, 0.98, level, (0.0, -4.0), "rd", NOTE, FAINT, inside=True)
                )
        if (own[:, 1] < y.low).any():
            chart.notes.append(Note(_ZERO, 0.98, y.low, (0.0, -8.0), "rd", NOTE, inside=True))
        chart.series += [replace(c, y=np.maximum(c.y, y.low)) for c in reversed(panel.curves)]
        chart.draw(paper)
    foot = paper.height - below + 80.0
    draw_legend(paper, entries, (paper.width / 2.0, foot), columns=in_row)
    if note:
        paper.text(note, (20.0, paper.height - 14.0), size=NOTE, anchor="ld", color=FAINT)
    return paper


def _points(curves: Sequence[Curve]) -> Floats:
    """All points (n, 2)."""
    parts = [np.stack([np.asarray(c.x, float), np.asarray(c.y, float)], axis=1) for c in curves]
    return np.concatenate([np.zeros((0, 2)), *parts])


def _check(points: Sequence[Floats]) -> None:
    if not points or any(len(own) == 0 for own in points):
        raise InputError("curves: expected a point in each panel, got none in one")
    x, y = np.concatenate(points).T
    if not (np.isfinite(x).all() and np.isfinite(y).all() and (x > 0.0).all() and (y >= 0.0).all()):
        raise InputError(
            "curves: expected positive times or sizes and values of at least 0, got "
            f"{x.min():g} and {y.min():g} as the smallest"
        )


def _heights(values: Floats, levels: Sequence[float]) -> Axis:
    """A logarithmic axis that has room for values (n,) and levels; zeros lie below it."""
    positive = np.concatenate([values[values > 0.0], levels])
    # Points of value 0 are set off by a decade more.
    room = 0.05 if (values == 0.0).any() else 0.5
    low = 10.0 ** np.floor(np.log10(room * float(positive.min(initial=1.0))))
    return Axis(low, 3.0 * max(float(positive.max(initial=0.0)), 10.0 * low), log=True)


def time_against_size_figure(
    curves: Sequence[Curve], title: str, size_label: str, note: str
) -> Paper:
    """Run times against the size of what was worked on; the first curve is drawn as what the others
    are compared with.

    curves: at least one, each with at least one point, sizes and seconds positive; their styles do
    not count. title: above; size_label: what the horizontal axis is called; note: small print.

    Raises InputError: there is nothing to draw, or a size or a time is not positive.
    """
    if any(len(np.asarray(curve.x)) == 0 for curve in curves):
        raise InputError("time against size: expected a point of each curve, got none of one")
    if any(np.min(curve.y) <= 0.0 for curve in curves):
        raise InputError("time against size: expected positive times, got one that is not")
    first = Style(DARK, "--", 3.0, "o", filled=False)
    colors = repeated(DISTINCT, len(curves))
    others = [
        Style(color, marker=m) for color, m in zip(colors, "s^Dvo" * len(colors), strict=False)
    ]
    styled = [replace(c, style=s) for c, s in zip(curves, [first, *others], strict=False)]
    panel = Panel(title, styled, y_label="run time (s)")
    return panels_figure([panel], 1, x_label=size_label, note=note)


@dataclass(frozen=True)
class DesignCurve:
    """One method of design on one problem.

    Attributes
    ----------
    label: what the legend calls it; methods of one label look alike in all panels.
    seconds: (n,) run times of the accepted steps, rising, n at least 1.
    errors, energies: (n,) at those times, at least 0.
    converged: whether it reached what was wanted.
    """

    label: str
    seconds: Sequence[float]
    errors: Sequence[float]
    energies: Sequence[float]
    converged: bool


@dataclass(frozen=True)
class DesignPanel:
    """One problem: its title, the error at which a design is done, and the methods tried on it."""

    title: str
    tolerance: float
    curves: tuple[DesignCurve, ...]


def design_methods_figure(panels: Sequence[DesignPanel]) -> Paper:
    """A row for each problem: on the left the smallest error, on the right the smallest dice energy
    found so far, and what a method ended with: a disc if it converged, a cross if it stopped short.

    Raises
    ------
    InputError: there is nothing to draw.
    """
    labels = list(dict.fromkeys(curve.label for panel in panels for curve in panel.curves))
    colors = dict(zip(labels, repeated(DISTINCT, len(labels)), strict=True))
    charts = []
    for panel in panels:
        for name, key in (("error, max |p − q|", "errors"), ("dice energy", "energies")):
            curves = [
                drawn
                for curve in panel.curves
                for drawn in _smallest_so_far(curve, getattr(curve, key), colors[curve.label])
            ]
            levels = {"": panel.tolerance} if key == "errors" else {}
            charts.append(Panel(f"{panel.title}: {name}", curves, levels, "smallest so far"))
    keys = [
        Curve([], [], _ending(DARK, True), "converged"),
        Curve([], [], _ending(DARK, False), "stopped short"),
        Curve([], [], _LEVEL, "tolerance"),
    ]
    return panels_figure(charts, 2, same_heights=False, keys=keys)


def _smallest_so_far(curve: DesignCurve, values: Sequence[float], color: str) -> list[Curve]:
    """The end of a curve, and below it the curve."""
    heights = np.asarray(values, dtype=np.float64)
    heights = np.maximum(heights, heights[0] * 10.0**-_DECADES)
    seconds = np.maximum(np.asarray(curve.seconds, dtype=np.float64), _FIRST)
    best = np.minimum.accumulate(heights)
    return [
        Curve(seconds[-1:], heights[-1:], _ending(color, curve.converged)),
        Curve(seconds, best, Style(color), curve.label, steps=True),
    ]


def _ending(color: str, converged: bool) -> Style:
    return Style(color, "", marker="o" if converged else "x", size=6.0)
