"""How a design came to its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, DARK, FAINT
from dicedesign.report.charts.png import agg_figure

__all__ = ["convergence_figure", "mark_zero"]

_MOST_MARKERS: Final = 60

_WIDE_RATIO: Final = 50.0

_PREFERENCES: Final = "preferences"
"""Term of the steps that are taken by preference."""


def mark_zero(axes: Axes) -> None:
    """Write 0 beside the lower border of logarithmic axes, on which values of zero are drawn."""
    axes.annotate(
        "0",
        (0.0, 0.0),
        xycoords="axes fraction",
        xytext=(-4, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=10,
    )


def convergence_figure(history: Sequence[Mapping[str, Any]], tolerance: float) -> Figure:
    """Error and energy of a design against its run time.

    Errors of exactly zero are drawn on the lower border, which is then marked 0. Of a design that
    went on by preference once its odds were met, the energy is drawn from there on: before, it is
    the error once more.

    Parameters
    ----------
    history: accepted steps, at least one, each with "seconds" since the start, "energy", its
        "terms" by name, and "max_abs_error", the largest |p - q|, at least 0.
    tolerance: error at which the design is done, above 0.

    Raises
    ------
    InputError: the history is empty.
    """
    if not history:
        raise InputError("history: expected at least one step, got none")
    seconds, energy, errors = (
        np.array([float(step[key]) for step in history])
        for key in ("seconds", "energy", "max_abs_error")
    )
    figure = agg_figure(9.6, 3.8)
    left = figure.add_axes((0.085, 0.15, 0.39, 0.74))
    right = figure.add_axes((0.59, 0.15, 0.39, 0.74))
    floor = min(float(errors[errors > 0.0].min(initial=tolerance)), tolerance) / 5.0
    top = max(float(errors.max()), tolerance) * 3.0
    _curve(left, seconds, np.maximum(errors, floor))
    left.axhline(tolerance, color=FAINT, linestyle="--", linewidth=1.2)
    left.annotate(
        f"tolerance {tolerance:.2g}",
        (0.0, tolerance),
        xycoords=("axes fraction", "data"),
        xytext=(4, -3),
        textcoords="offset points",
        va="top",
        fontsize=8,
        color=FAINT,
    )
    left.set_yscale("log")
    left.set_ylim(floor, top)
    if (errors == 0.0).any():
        mark_zero(left)
    left.set_ylabel("error, max |p − q|")
    left.set_title("error against run time", fontsize=11, color=DARK)
    liked = np.array([_PREFERENCES in step["terms"] for step in history])
    name = "energy of preferences" if liked.any() else "energy"
    shown = liked | ~liked.any()
    _curve(right, seconds[shown], energy[shown])
    if energy.min() > 0.0 and energy[shown].max() > _WIDE_RATIO * energy[shown].min():
        right.set_yscale("log")
    right.set_ylabel(name)
    right.set_title(f"{name} against run time", fontsize=11, color=DARK)
    return figure


def _curve(axes: Axes, seconds: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """A curve over run time, with its points marked where they are few."""
    marker = "o" if len(values) <= _MOST_MARKERS else ""
    axes.plot(seconds, values, color=ACCENT, marker=marker, markersize=3.5, clip_on=False)
    axes.set_xlim(0.0, 1.03 * max(float(seconds.max()), 1e-3))
    axes.set_xlabel("run time (s)")
    axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
