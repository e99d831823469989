"""How far predictions are from what was thrown, die by die."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.palette import ACCENT, FAINT, PALE
from dicedesign.report.charts.paper import NOTE, Paper
from dicedesign.report.charts.series import Bars, Levels
from dicedesign.runtime.arrays import Floats

__all__ = ["deviation_bars_chart", "deviation_bars_figure"]

_WIDTHS: Final = (0.86, 0.5)
"""Of the bars, the first behind the second, in units of their distance."""


def deviation_bars_chart(deviations: Mapping[str, Floats], floors: Floats, title: str) -> Chart:
    """For each die a bar of one prediction's total variation, in front of it one of another's, and
    a line at the noise floor; dice in descending order of the first. The legend has the means.

    Parameters
    ----------
    deviations: two predictions -> (n,) total variation of each die, 0 to 1, n at least 1.
    floors: (n,) mean total variation of right odds.
    title: above the figure.

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
    chart = Chart(
        (125.0, 100.0, 1500.0, 560.0),
        Axis(-0.7, len(order) - 0.3, "dice, the farthest from the odds without momentum first"),
        Axis(0.0, 1.05 * max(map(np.max, deviations.values())), "total variation to the throws"),
        title=title,
        grid="y",
        legend=3,
    )
    chart.x = Axis(chart.x.low, chart.x.high, chart.x.label, ticks=())
    for (name, values), width, color in zip(
        deviations.items(), _WIDTHS, (PALE, ACCENT), strict=True
    ):
        label = f"{name}: mean {values.mean():.3f}, worst {values.max():.3f}"
        chart.series.append(Bars(places, values[order], width, color, label))
    label = f"right odds, on the mean: {floors.mean():.3f}"
    chart.series.append(Levels(places, floors[order], _WIDTHS[0], label=label))
    return chart


def deviation_bars_figure(
    deviations: Mapping[str, Floats], floors: Floats, title: str, note: str = ""
) -> Paper:
    """`deviation_bars_chart` with small print at the foot."""
    paper = sheet([deviation_bars_chart(deviations, floors, title)])
    paper.text(note, (20.0, paper.height - 14.0), size=NOTE, anchor="ld", color=FAINT)
    return paper
