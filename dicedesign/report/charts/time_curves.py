"""Errors of several methods against their run times, both on logarithmic axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import DARK, FAINT
from dicedesign.report.charts.png import agg_figure

__all__ = ["DISTINCT", "ErrorCurve", "ErrorPanel", "error_against_time_figure", "style_axes"]

DISTINCT: Final = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9")
"""Line colours that the colour-blind tell apart. Source: M. Okabe and K. Ito, Color Universal
Design (2008)."""

_WIDTHS: Final = (5.6, 8.0, 10.0)
"""Inches of a figure with one, two, and three or more panels side by side."""

_ROW: Final = 3.7
"""Inches for each row of panels with its titles and axes."""

_ZERO: Final = "border: error 0"

_LEGEND_ROW: Final = 0.24
"""Inches for each row of the legend."""


@dataclass(frozen=True)
class ErrorCurve:
    """One method.

    Attributes
    ----------
    label: what the legend calls it; curves of one label look alike in all panels.
    seconds: (k,) run times, positive.
    errors: (k,) at least 0; zeros are drawn at the panel's lower border, which then says so.
    color: of line and markers, best one of `DISTINCT`.
    marker: matplotlib's, "" for a line alone.
    filled: whether markers are.
    line: matplotlib's line style, "" for points alone.
    """

    label: str
    seconds: tuple[float, ...]
    errors: tuple[float, ...]
    color: str = DISTINCT[0]
    marker: str = "o"
    filled: bool = True
    line: Literal["-", "--", ":", ""] = "-"


@dataclass(frozen=True)
class ErrorPanel:
    """One problem: its title and the methods tried on it, earlier ones drawn above later ones."""

    title: str
    curves: tuple[ErrorCurve, ...]


def error_against_time_figure(
    panels: Sequence[ErrorPanel],
    levels: Mapping[str, float],
    error_label: str = "error, max |p − q|",
) -> Figure:
    """Panels on common axes, with one legend below.

    Parameters
    ----------
    panels: at least one, each with at least one point.
    levels: errors marked by a horizontal line and a name, such as machine precision; above 0.
    error_label: what the vertical axis is called.

    Raises
    ------
    InputError: there is nothing to draw, a time is not positive, or an error is negative or not a
        number.
    """
    seconds, errors = _values(panels)
    positive = np.concatenate([errors[errors > 0.0], list(levels.values())])
    # Points of error 0 are set off by a decade more.
    room = 0.05 if (errors == 0.0).any() else 0.5
    floor = 10.0 ** np.floor(np.log10(room * float(positive.min(initial=1.0))))
    top = 3.0 * max(float(positive.max(initial=0.0)), 10.0 * floor)
    columns = min(len(panels), len(_WIDTHS))
    rows = -(-len(panels) // columns)
    handles = _handles(panels)
    entries = min(len(handles), columns + 1)
    legend = _LEGEND_ROW * -(-len(handles) // entries)
    width, height = _WIDTHS[columns - 1], rows * _ROW + legend + 0.1
    figure = agg_figure(width, height)
    grid = figure.add_gridspec(
        rows,
        columns,
        left=0.75 / width,
        right=1.0 - 0.15 / width,
        top=1.0 - 0.32 / height,
        bottom=(0.58 + legend) / height,
        wspace=0.06,
        hspace=0.15,
    )
    for place, panel in enumerate(panels):
        axes = figure.add_subplot(grid[place // columns, place % columns])
        axes.set(xscale="log", yscale="log", ylim=(floor, top))
        axes.set_xlim(seconds.min() / 1.8, seconds.max() * 1.8)
        _draw(axes, panel, levels, floor)
        style_axes(axes, panel.title)
        if place % columns == 0:
            axes.set_ylabel(error_label)
        else:
            axes.tick_params(labelleft=False)
        if place + columns >= len(panels):
            axes.set_xlabel("run time (s)")
        else:
            axes.tick_params(labelbottom=False)
    _name_levels(figure.axes[0], levels)
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=entries,
        frameon=False,
        fontsize=9,
        handlelength=2.6,
        columnspacing=1.8,
    )
    return figure


def style_axes(axes: Axes, title: str) -> None:
    """A title, a faint grid, and no frame: for logarithmic axes whose decades alone have ticks."""
    axes.set_title(title, fontsize=11, color=DARK)
    axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    axes.minorticks_off()
    axes.spines[["top", "right"]].set_visible(False)


def _draw(axes: Axes, panel: ErrorPanel, levels: Mapping[str, float], floor: float) -> None:
    for level in levels.values():
        axes.axhline(level, color=FAINT, linestyle="--", linewidth=1.0, zorder=1)
    for order, curve in enumerate(panel.curves):
        line = _line(curve, curve.seconds, tuple(max(error, floor) for error in curve.errors))
        line.set_zorder(3 + len(panel.curves) - order)
        axes.add_line(line)
    if any(error == 0.0 for curve in panel.curves for error in curve.errors):
        axes.annotate(
            _ZERO,
            (0.98, 0.0),
            xycoords="axes fraction",
            xytext=(0, 6),
            textcoords="offset points",
            ha="right",
            fontsize=8.5,
            color=DARK,
        )


def _name_levels(axes: Axes, levels: Mapping[str, float]) -> None:
    for name, level in levels.items():
        axes.annotate(
            name,
            (0.98, level),
            xycoords=("axes fraction", "data"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right",
            fontsize=8.5,
            color=FAINT,
        )


def _line(curve: ErrorCurve, seconds: tuple[float, ...], errors: tuple[float, ...]) -> Line2D:
    return Line2D(
        seconds,
        errors,
        label=curve.label,
        color=curve.color,
        linestyle=curve.line,
        linewidth=1.6 if curve.marker else 1.2,
        marker=curve.marker,
        markersize=9.0 if curve.marker == "*" else 7.0 if curve.line == "" else 5.0,
        markerfacecolor=curve.color if curve.filled else "white",
        markeredgewidth=1.2,
        # Points at the lower border, whose error is 0, are drawn whole.
        clip_on=False,
    )


def _handles(panels: Sequence[ErrorPanel]) -> list[Line2D]:
    """A legend entry for each label, in the order of their first appearance."""
    first: dict[str, Line2D] = {}
    for curve in (curve for panel in panels for curve in panel.curves):
        first.setdefault(curve.label, _line(curve, (), ()))
    return list(first.values())


def _values(panels: Sequence[ErrorPanel]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    curves = [curve for panel in panels for curve in panel.curves]
    seconds = np.array([value for curve in curves for value in curve.seconds])
    errors = np.array([value for curve in curves for value in curve.errors])
    if not panels or any(all(not c.seconds for c in panel.curves) for panel in panels):
        raise InputError("error against time: expected a point in each panel, got none in one")
    good = np.isfinite(seconds).all() and np.isfinite(errors).all()
    if not (good and (seconds > 0.0).all() and (errors >= 0.0).all()):
        raise InputError(
            "error against time: expected positive run times and errors of at least 0, got "
            f"{seconds.min():g} seconds and {errors.min():g} as the smallest"
        )
    return seconds, errors
