"""Odds before and after a deformation, beside the target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, DARK, PALE
from dicedesign.report.charts.png import agg_figure
from dicedesign.runtime.arrays import Floats

__all__ = ["odds_before_after_figure"]

_MOST_VALUES: Final = 12

_MOST_LEVEL_LABELS: Final = 24

_BAR_WIDTH: Final = 0.36

_MARK_WIDTH: Final = 0.86

_ELSEWHERE_GAP: Final = 0.35

_BORDER_HEIGHT: Final = 0.85


def odds_before_after_figure(
    labels: Sequence[str],
    target: Floats,
    before: Floats,
    after: Floats,
    elsewhere_before: float,
    elsewhere_after: float,
) -> Figure:
    """A pair of bars for each outcome with a line at its target, and one for all other rests.

    The values stand above the bars of at most 12 outcomes.

    Parameters
    ----------
    labels: k outcomes, at least one.
    target, before, after: (k,) probabilities in [0, 1].
    elsewhere_before, elsewhere_after: probability in [0, 1] of all rests that belong to no outcome.

    Raises
    ------
    InputError: there is no outcome, or not one of each probability for each.
    """
    if not 0 < len(labels) == len(target) == len(before) == len(after):
        raise InputError(
            "odds: expected at least one outcome, with one target and one probability before and "
            f"after each, got {len(labels)} labels, {len(target)} targets, {len(before)} before "
            f"and {len(after)} after"
        )
    count = len(labels)
    figure = agg_figure(min(max(8.4, 0.75 * (count + 1) + 1.2), 12.0), 3.9)
    axes = figure.add_axes((0.09, 0.17, 0.89, 0.70))
    places = np.arange(count + 1.0)
    places[count] += _ELSEWHERE_GAP
    for values, other, side, color, name in (
        (before, elsewhere_before, -1, PALE, "before"),
        (after, elsewhere_after, 1, ACCENT, "after"),
    ):
        percent = 100.0 * np.append(values, other)
        bars = axes.bar(
            places + side * _BAR_WIDTH / 2.0, percent, _BAR_WIDTH, color=color, label=name
        )
        if count <= _MOST_VALUES:
            axes.bar_label(bars, fmt="%.2f", fontsize=7, padding=3, rotation=90, color=DARK)
    wanted = 100.0 * np.append(target, 0.0)
    half = _MARK_WIDTH / 2
    axes.hlines(wanted, places - half, places + half, colors=DARK, linewidths=1.6, label="target")
    # Room above the bars for the upright values and the legend.
    axes.set_ylim(0.0, 1.35 * max(axes.dataLim.ymax, 1e-9))
    axes.set_xlim(-0.6, places[-1] + 0.6)
    border = count - 0.5 + _ELSEWHERE_GAP / 2
    axes.axvline(border, ymax=_BORDER_HEIGHT, color=PALE, linewidth=0.8, linestyle=":")
    rotation = 0 if count <= _MOST_LEVEL_LABELS else 90
    axes.set_xticks(places, [*labels, "elsewhere"], fontsize=9, rotation=rotation, parse_math=False)
    axes.set_xlabel("outcome that the body comes to rest on")
    axes.set_ylabel("probability (%)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper right", ncols=3, frameon=False, fontsize=9)
    errors = [float(np.abs(values - target).max()) for values in (before, after)]
    axes.set_title(
        f"max |p − q| = {errors[0]:.2g} before, {errors[1]:.2g} after", fontsize=11, color=DARK
    )
    return figure
