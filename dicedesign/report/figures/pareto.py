"""Two measures of many dice against each other."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, DARK, FAINT, PALE
from dicedesign.report.charts.png import agg_figure

__all__ = ["pareto_figure"]

_NUMBER_POINTS: Final = np.array([18.0, 10.0])
"""Room for a number, in points."""


def pareto_figure(
    trials: Sequence[Mapping[str, Any]], front: Collection[int], named: Sequence[int]
) -> Figure:
    """Smallest circle of each die of a search against its momentum margin.

    Parameters
    ----------
    trials: at least one, each with "number", "status" ("converged", or another where the die is not
        as wanted), "inradius_mm" and "margin_deg", at least 0, both None where there is nothing
        to measure; those are only counted.
    front: numbers of converged trials that no other beats in both; they are joined by steps.
    named: numbers of converged trials that are written beside their points, the first first; one
        that would cover an earlier one is left out.

    Raises
    ------
    InputError: there is no trial.
    """
    if not trials:
        raise InputError("trials: expected at least one, got none; run a trial")
    figure = agg_figure(8.0, 5.2)
    axes = figure.add_axes((0.085, 0.17, 0.885, 0.76))
    measured = [trial for trial in trials if trial["inradius_mm"] is not None]
    solved = [trial for trial in measured if trial["status"] == "converged"]
    missed = [trial for trial in measured if trial["status"] != "converged"]
    best = [trial for trial in solved if trial["number"] in front]
    beaten = [trial for trial in solved if trial["number"] not in front]
    groups = (
        (missed, "not converged", FAINT, "x"),
        (beaten, "converged", PALE, "o"),
        (best, "Pareto front: no die beats it in both", ACCENT, "o"),
    )
    for order, (group, label, color, marker) in enumerate(groups):
        radii, margins = _columns(group)
        size = 26 if marker == "x" else 40
        axes.scatter(
            radii,
            margins,
            s=size,
            c=color,
            marker=marker,
            linewidths=1.2 if marker == "x" else 0.6,
            edgecolors=None if marker == "x" else "white",
            zorder=3 + order,
            label=f"{label} ({len(group)})",
        )
    if best:
        radii, margins = _columns(sorted(best, key=lambda trial: -trial["margin_deg"]))
        radii = np.concatenate([[0.0], radii, radii[-1:]])
        margins = np.concatenate([margins[:1], margins, [0.0]])
        axes.plot(radii, margins, color=ACCENT, linewidth=1.2, drawstyle="steps-pre", zorder=2)
    _style(axes, *_columns(measured))
    by_number = {trial["number"]: trial for trial in solved}
    _write_numbers(axes, [by_number[number] for number in named], figure.dpi)
    handles, labels = axes.get_legend_handles_labels()
    if len(trials) > len(measured):
        handles.append(Line2D([], [], linestyle=""))
        labels.append(f"nothing to measure ({len(trials) - len(measured)})")
    figure.legend(handles, labels, fontsize=9.5, loc="lower center", ncols=4, frameon=False)
    return figure


def _write_numbers(axes: Axes, trials: Sequence[Mapping[str, Any]], dpi: float) -> None:
    """Numbers beside the points of trials, in this order, where none is in the way."""
    points = axes.transData.transform(np.stack(_columns(trials), axis=1))
    free = 72.0 / dpi * points
    written: list[np.ndarray] = []
    for trial, point in zip(trials, free, strict=True):
        if any((np.abs(point - other) < _NUMBER_POINTS).all() for other in written):
            continue
        written.append(point)
        axes.annotate(
            str(trial["number"]),
            (trial["inradius_mm"], trial["margin_deg"]),
            xytext=(5, 4),
            textcoords="offset points",
            fontsize=8,
            color=DARK,
            zorder=7,
        )


def _columns(trials: Sequence[Mapping[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Radii and margins."""
    return (
        np.array([float(trial["inradius_mm"]) for trial in trials]),
        np.array([float(trial["margin_deg"]) for trial in trials]),
    )


def _style(axes: Axes, radii: np.ndarray, margins: np.ndarray) -> None:
    for values, limit in ((radii, axes.set_xlim), (margins, axes.set_ylim)):
        low, high = values.min(initial=np.inf), values.max(initial=0.0)
        room = 0.08 * (high - low) if high > low else 0.1 * max(high, 1.0)
        if np.isfinite(low):
            limit(max(low - room, 0.0), high + room)
    axes.set_xlabel("radius of the smallest inscribed circle (mm)")
    axes.set_ylabel("momentum margin (°)")
    axes.set_title("larger is better in both", fontsize=11, color=DARK)
    axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
