"""Frequencies of a die's throws beside its odds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, DARK, PALE
from dicedesign.report.charts.png import agg_figure
from dicedesign.throws.counts.roll_verdict import RollVerdict

__all__ = ["rolls_figure"]

_MOST_VALUES: Final = 16

_MOST_LEVEL_LABELS: Final = 24

_BAR_WIDTH: Final = 0.4


def rolls_figure(labels: Sequence[str], verdict: RollVerdict) -> Figure:
    """A pair of bars for each outcome, with the exact interval of its probability, and above the
    bars of at most 16 outcomes their counts.

    labels: k outcomes, as many as the verdict has.

    Raises
    ------
    InputError: there is not one label for each outcome.
    """
    if len(labels) != len(verdict.odds):
        raise InputError(
            f"rolls: expected {len(verdict.odds)} labels, one for each outcome, got {len(labels)}"
        )
    count = len(labels)
    figure = agg_figure(min(max(6.4, 0.75 * count + 1.2), 12.0), 4.2)
    axes = figure.add_axes((0.09, 0.17, 0.89, 0.70))
    places = np.arange(count)
    percent = 100.0 * verdict.frequencies
    limits = 100.0 * verdict.intervals
    axes.bar(
        places - _BAR_WIDTH / 2, 100.0 * verdict.odds, _BAR_WIDTH, color=PALE, label="odds tested"
    )
    axes.bar(places + _BAR_WIDTH / 2, percent, _BAR_WIDTH, color=ACCENT, label="thrown")
    axes.errorbar(
        places + _BAR_WIDTH / 2,
        percent,
        yerr=[percent - limits[:, 0], limits[:, 1] - percent],
        fmt="none",
        ecolor=DARK,
        elinewidth=1.1,
        capsize=3.0,
        label=f"exact {100 * verdict.confidence:g} % interval",
    )
    if count <= _MOST_VALUES:
        for place, top, number in zip(places, limits[:, 1], verdict.counts, strict=True):
            axes.annotate(
                str(number),
                (place + _BAR_WIDTH / 2, top),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                fontsize=7,
                color=DARK,
            )
    # Room above the bars for the counts and the legend.
    axes.set_ylim(0.0, 1.25 * max(limits[:, 1].max(), 100.0 * verdict.odds.max()))
    axes.set_xlim(-0.6, count - 0.4)
    rotation = 0 if count <= _MOST_LEVEL_LABELS else 90
    axes.set_xticks(places, labels, fontsize=9, rotation=rotation, parse_math=False)
    axes.set_xlabel("outcome")
    axes.set_ylabel("probability (%)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper right", ncols=3, frameon=False, fontsize=9)
    variation = verdict.variation
    axes.set_title(
        f"{verdict.throws} throws: p = {verdict.p_value:.2g}, total variation "
        f"{variation.value:.3f} (a perfect die: {variation.noise_floor:.3f})",
        fontsize=11,
        color=DARK,
    )
    return figure
