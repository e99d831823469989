"""Run times against the size of what was worked on, both on logarithmic axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import DARK, FAINT
from dicedesign.report.charts.png import agg_figure
from dicedesign.report.charts.time_curves import DISTINCT, style_axes

__all__ = ["TimeCurve", "time_against_size_figure"]

_WIDTH: Final = 7.2

_HEIGHT: Final = 5.0

_MARKERS: Final = ("o", "s", "^", "D", "v")


@dataclass(frozen=True)
class TimeCurve:
    """One way to work.

    Attributes
    ----------
    label: what the legend calls it.
    sizes: (k,) sizes, positive.
    seconds: (k,) run times, positive.
    """

    label: str
    sizes: Sequence[float]
    seconds: Sequence[float]


def time_against_size_figure(
    curves: Sequence[TimeCurve], title: str, size_label: str, note: str
) -> Figure:
    """A curve for each way, named in a legend; the first is drawn as what the others are compared
    with.

    Parameters
    ----------
    curves: at least one, each with at least one point; colours repeat after `DISTINCT`.
    title: above the figure.
    size_label: what the horizontal axis is called.
    note: small print at the foot, such as the machine and the date.

    Raises
    ------
    InputError: there is nothing to draw, or a size or a time is not positive.
    """
    values = [value for curve in curves for value in (*curve.sizes, *curve.seconds)]
    if not curves or any(len(curve.sizes) == 0 for curve in curves):
        raise InputError("time against size: expected a point of each curve, got none of one")
    if not (np.isfinite(values).all() and min(values) > 0.0):
        raise InputError(
            f"time against size: expected positive sizes and times, got {min(values):g} as the "
            "smallest"
        )
    figure = agg_figure(_WIDTH, _HEIGHT)
    axes = figure.add_axes(
        (0.78 / _WIDTH, 0.85 / _HEIGHT, 1.0 - 1.0 / _WIDTH, 1.0 - 1.25 / _HEIGHT)
    )
    axes.set(xscale="log", yscale="log", xlabel=size_label, ylabel="run time (s)")
    for order, curve in enumerate(curves):
        compared = order == 0
        axes.plot(
            curve.sizes,
            curve.seconds,
            label=curve.label,
            color=DARK if compared else DISTINCT[(order - 1) % len(DISTINCT)],
            linestyle="--" if compared else "-",
            linewidth=1.6,
            marker=_MARKERS[order % len(_MARKERS)],
            markersize=5.0,
            markerfacecolor="white" if compared else None,
            zorder=3 + len(curves) - order,
        )
    style_axes(axes, title)
    axes.legend(loc="upper left", frameon=False, fontsize=9.5, handlelength=3.0)
    figure.text(0.78 / _WIDTH, 0.14 / _HEIGHT, note, fontsize=8.0, color=FAINT)
    return figure
