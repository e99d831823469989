"""Methods of design compared: error and energy against run time, both on logarithmic axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import DARK, FAINT
from dicedesign.report.charts.png import agg_figure
from dicedesign.report.charts.time_curves import DISTINCT, style_axes

__all__ = ["DesignCurve", "DesignPanel", "design_methods_figure"]

_WIDTH: Final = 10.0

_ROW: Final = 2.9

_LEGEND_ROW: Final = 0.26

_COLUMNS: Final = 3
"""Columns of the legend."""

_FIRST: Final = 1e-3
"""Seconds at which the time axis begins."""

_TOLERANCE: Final[dict[str, Any]] = {"color": FAINT, "linestyle": "--", "linewidth": 1.0}

_DECADES: Final = 16
"""Values this many powers of ten below the largest of a panel are drawn on its lower border."""


@dataclass(frozen=True)
class DesignCurve:
    """One method on one problem.

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


def design_methods_figure(panels: Sequence[DesignPanel]) -> Figure:
    """A row for each problem: on the left the smallest error, on the right the smallest dice energy
    found so far, and what a method ended with: a disc if it converged, a cross if it stopped short.

    Raises
    ------
    InputError: there is nothing to draw.
    """
    if not panels or any(not panel.curves for panel in panels):
        raise InputError("methods: expected a curve in each panel, got none; run a method")
    labels = list(dict.fromkeys(curve.label for panel in panels for curve in panel.curves))
    colors = {label: DISTINCT[i % len(DISTINCT)] for i, label in enumerate(labels)}
    legend = _LEGEND_ROW * -(-(len(labels) + 3) // _COLUMNS)
    height = _ROW * len(panels) + legend + 0.55
    figure = agg_figure(_WIDTH, height)
    grid = figure.add_gridspec(
        len(panels),
        2,
        left=0.8 / _WIDTH,
        right=1.0 - 0.15 / _WIDTH,
        top=1.0 - 0.35 / height,
        bottom=(0.55 + legend) / height,
        wspace=0.2,
        hspace=0.28,
    )
    latest = max(float(curve.seconds[-1]) for panel in panels for curve in panel.curves)
    for row, panel in enumerate(panels):
        pair = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
        for curve in panel.curves:
            _draw(pair[0], curve, curve.errors, colors[curve.label])
            _draw(pair[1], curve, curve.energies, colors[curve.label])
        pair[0].axhline(panel.tolerance, **_TOLERANCE, zorder=1)
        for axes, what in zip(pair, ("error, max |p − q|", "dice energy"), strict=True):
            axes.set_xlim(_FIRST, 1.3 * max(latest, 10.0 * _FIRST))
            style_axes(axes, f"{panel.title}: {what}")
            if row == len(panels) - 1:
                axes.set_xlabel("run time (s)")
            else:
                axes.tick_params(labelbottom=False)
        pair[0].set_ylabel("smallest so far")
    handles = [Line2D([], [], color=colors[label], linewidth=1.8, label=label) for label in labels]
    handles += [_ending(DARK, True, "converged"), _ending(DARK, False, "stopped short")]
    handles.append(Line2D([], [], **_TOLERANCE, label="tolerance"))
    figure.legend(handles=handles, loc="lower center", ncols=_COLUMNS, frameon=False, fontsize=9.5)
    return figure


def _draw(axes: Axes, curve: DesignCurve, values: Sequence[float], color: str) -> None:
    found = np.asarray(values, dtype=np.float64)
    found = np.maximum(found, found[0] * 10.0**-_DECADES)
    best = np.minimum.accumulate(found)
    seconds = np.maximum(np.asarray(curve.seconds, dtype=np.float64), _FIRST)
    axes.loglog(seconds, best, color=color, linewidth=1.6, drawstyle="steps-post")
    end = _ending(color, curve.converged, "")
    end.set_data(seconds[-1:], found[-1:])
    axes.add_line(end)


def _ending(color: str, converged: bool, label: str) -> Line2D:
    return Line2D(
        [],
        [],
        color=color,
        linestyle="",
        marker="o" if converged else "x",
        markersize=6.0 if converged else 7.0,
        markeredgewidth=1.8,
        label=label,
        clip_on=False,
        zorder=4,
    )
