"""What each stage of a design of several stages minimised, over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, BASINS, DARK, FAINT
from dicedesign.report.charts.png import agg_figure
from dicedesign.report.figures.convergence import mark_zero
from dicedesign.runtime.arrays import Floats

__all__ = ["stage_energies_figure"]

_MOST_MARKERS: Final = 40

_SHADE: Final = 0.35

_MOST_DECADES: Final = 14


def stage_energies_figure(history: Sequence[Mapping[str, Any]]) -> Figure:
    """Error and energy against run time, both logarithmic, with a coloured stretch per stage.

    Each stage has an energy of its own, so the curve is broken between stages. Values of zero, and
    below 1e-14 of the largest, are drawn on the lower border, which is then marked 0.

    Parameters
    ----------
    history: steps in the order of time, at least one, each with "seconds" since the start, the name
        of its "stage", its "energy", at least 0, or None, and its "error", the largest |p - q|, at
        least 0, or None where it was not computed. A stage may come more than once.

    Raises
    ------
    InputError: the history is empty.
    """
    if not history:
        raise InputError("history: expected at least one step, got none")
    figure = agg_figure(9.6, 4.1)
    runs = [(name, list(steps)) for name, steps in groupby(history, lambda step: step["stage"])]
    names = list(dict.fromkeys(name for name, _ in runs))
    colors = dict(zip(names, BASINS * (len(names) // len(BASINS) + 1), strict=False))
    last = max(float(history[-1]["seconds"]), 1e-3)
    for left, key, name, title in (
        (0.085, "error", "error, max |p − q|", "error against run time"),
        (0.59, "energy", "energy", "energy of each stage against run time"),
    ):
        axes = figure.add_axes((left, 0.25, 0.39, 0.65))
        begin = 0.0
        for stage, steps in runs:
            end = float(steps[-1]["seconds"])
            axes.axvspan(begin, end, color=colors[stage], alpha=_SHADE, linewidth=0)
            begin = end
        parts = [[step for step in steps if step[key] is not None] for _, steps in runs]
        if key == "error":
            parts = [[step for part in parts for step in part]]
        _curves(axes, [_columns(part, key) for part in parts if part])
        axes.set_xlim(0.0, 1.02 * last)
        axes.set_xlabel("run time (s)")
        axes.set_ylabel(name)
        axes.set_title(title, fontsize=11, color=DARK)
        axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(
        [Patch(facecolor=colors[name], alpha=_SHADE) for name in names],
        names,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.01),
        ncols=min(len(names), 8),
        fontsize=9,
        labelcolor=DARK,
        frameon=False,
    )
    return figure


def _columns(steps: Sequence[Mapping[str, Any]], key: str) -> Floats:
    """(2, n) seconds and values."""
    return np.array([[step["seconds"] for step in steps], [step[key] for step in steps]], float)


def _curves(axes: Axes, curves: Sequence[Floats]) -> None:
    """Broken curves, each (2, n), on a logarithmic scale."""
    axes.set_yscale("log")
    if not curves:
        axes.text(0.5, 0.5, "not known", transform=axes.transAxes, ha="center", color=FAINT)
        return
    values = np.concatenate([curve[1] for curve in curves])
    top = float(values.max()) or 1.0
    positive = values[values > top * 10.0**-_MOST_DECADES]
    lowest = float(positive.min(initial=top))
    floor = lowest / 5.0
    for seconds, heights in curves:
        marker = "o" if len(values) <= _MOST_MARKERS or len(seconds) == 1 else ""
        axes.plot(
            seconds,
            np.where(heights >= lowest, heights, floor),
            color=ACCENT,
            marker=marker,
            markersize=3.5,
            clip_on=False,
        )
    axes.set_ylim(floor, top * 3.0)
    if len(positive) < len(values):
        mark_zero(axes)
