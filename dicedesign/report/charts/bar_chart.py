"""How far predictions are from what was thrown, die by die."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, DARK, FAINT, PALE
from dicedesign.report.charts.png import agg_figure
from dicedesign.runtime.arrays import Floats

__all__ = ["deviation_bars_figure"]

_WIDTHS: Final = (0.86, 0.5)
"""Of the bars, the first behind the second, in units of their distance."""


def deviation_bars_figure(
    deviations: Mapping[str, Floats], floors: Floats, title: str, note: str = ""
) -> Figure:
    """For each die a bar of one prediction's total variation, in front of it one of another's, and
    a line at the noise floor; dice in descending order of the first. The legend has the means.

    Parameters
    ----------
    deviations: two predictions -> (n,) total variation of each die, 0 to 1, n at least 1.
    floors: (n,) mean total variation of right odds.
    title: above the figure. note: small print at the foot.

    Raises InputError: not two predictions, or not one number for each die.
    """
    lengths = {len(floors), *map(len, deviations.values())}
    if len(deviations) != 2 or len(lengths) != 1 or 0 in lengths:
        raise InputError(
            "deviation bars: expected two predictions with one total variation and one noise floor "
            f"for each die, got {len(deviations)} predictions of "
            f"{', '.join(str(len(values)) for values in deviations.values())} dice and "
            f"{len(floors)} floors; pass as many of each"
        )
    order = np.argsort(-next(iter(deviations.values())), kind="stable")
    places = np.arange(len(order))
    figure = agg_figure(10.2, 4.4)
    axes = figure.add_axes((0.07, 0.14, 0.91, 0.75))
    handles: list[Artist] = []
    labels = []
    for (name, values), width, color in zip(
        deviations.items(), _WIDTHS, (PALE, ACCENT), strict=True
    ):
        labels.append(f"{name}: mean {values.mean():.3f}, worst {values.max():.3f}")
        bars = axes.bar(places, values[order], width, color=color, linewidth=0)
        handles.append(bars[0])
    line = axes.hlines(
        floors[order], places - _WIDTHS[0] / 2.0, places + _WIDTHS[0] / 2.0, DARK, linewidth=1.2
    )
    handles.append(line)
    axes.set(xlim=(-0.7, len(order) - 0.3), xticks=[], ylabel="total variation to the throws")
    axes.set_title(title, fontsize=11, color=DARK, loc="left")
    axes.set_xlabel("dice, the farthest from the odds without momentum first", color=DARK)
    axes.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    labels.append(f"right odds, on the mean: {floors.mean():.3f}")
    axes.legend(handles, labels, frameon=False, fontsize=9.5, labelcolor=DARK, loc="upper right")
    figure.text(0.07, 0.02, note, fontsize=8.0, color=FAINT)
    return figure
