"""Target odds beside the achieved ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, DARK, PALE
from dicedesign.report.charts.png import agg_figure

__all__ = ["bars_figure"]

_MOST_VALUES: Final = 12

_MOST_LEVEL_LABELS: Final = 24

_BAR_WIDTH: Final = 0.4


def bars_figure(
    labels: Sequence[str], target: NDArray[np.float64], achieved: NDArray[np.float64]
) -> Figure:
    """A pair of bars for each outcome, with the values above them for at most 12 outcomes.

    Parameters
    ----------
    labels: k outcomes, at least one.
    target, achieved: (k,) probabilities in [0, 1].

    Raises
    ------
    InputError: there is no outcome, or not one target and one achieved probability for each.
    """
    if not 0 < len(labels) == len(target) == len(achieved):
        raise InputError(
            "bars: expected at least one outcome, with one target and one achieved probability "
            f"each, got {len(labels)} labels, {len(target)} targets and {len(achieved)} achieved"
        )
    count = len(labels)
    figure = agg_figure(min(max(6.4, 0.75 * count + 1.2), 12.0), 4.2)
    axes = figure.add_axes((0.09, 0.17, 0.89, 0.70))
    places = np.arange(count)
    for values, side, color, name in (
        (target, -1, PALE, "target"),
        (achieved, 1, ACCENT, "achieved"),
    ):
        percent = 100.0 * np.asarray(values, dtype=np.float64)
        bars = axes.bar(
            places + side * _BAR_WIDTH / 2, percent, _BAR_WIDTH, color=color, label=name
        )
        if count <= _MOST_VALUES:
            axes.bar_label(bars, fmt="%.2f", fontsize=7, padding=2, rotation=90, color=DARK)
    # Room above the bars for the upright values and the legend.
    axes.set_ylim(0.0, 1.3 * max(axes.dataLim.ymax, 1e-9))
    axes.set_xlim(-0.6, count - 0.4)
    rotation = 0 if count <= _MOST_LEVEL_LABELS else 90
    axes.set_xticks(places, labels, fontsize=9, rotation=rotation, parse_math=False)
    axes.set_xlabel("outcome (label on the facet that the body rests on)")
    axes.set_ylabel("probability (%)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper right", ncols=2, frameon=False, fontsize=9)
    worst = float(np.abs(np.asarray(target) - np.asarray(achieved)).max())
    axes.set_title(f"target and achieved odds, max |p − q| = {worst:.2g}", fontsize=11, color=DARK)
    return figure
