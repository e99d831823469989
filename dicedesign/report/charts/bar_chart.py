"""Odds of outcomes as bars beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, legend_height, legend_width
from dicedesign.report.charts.palette import PALE
from dicedesign.report.charts.paper import TINY, TITLE, text_width
from dicedesign.report.charts.series import Bars, Intervals, Levels, Note, Series

__all__ = ["OddsBars", "odds_chart"]

_MOST_VALUES: Final = 16
"""Outcomes above whose bars values are written."""

_LEGEND_COLUMNS: Final = 5

_GROUP: Final = 0.8
"""Width of the bars of one outcome, over the distance of outcomes."""

_TARGET: Final = 0.92
"""The same, of the wide bar behind them."""

_WITHIN: Final = 1.96
"""Standard deviations about the mean that hold 95 % of what is normal."""


@dataclass(frozen=True)
class OddsBars:
    """One kind of odds.

    Attributes
    ----------
    name: in the legend.
    color: of the bars.
    odds: (k,) probabilities in [0, 1].
    intervals: (k, 2) limits drawn around them, or None.
    interval_name: in the legend.
    values: written above the bars, k texts, or empty for none.
    """

    name: str
    color: str
    odds: ArrayLike
    intervals: ArrayLike | None = None
    interval_name: str = ""
    values: Sequence[str] = ()

    @classmethod
    def written(cls, name: str, color: str, odds: ArrayLike) -> OddsBars:
        """With the odds in percent above them."""
        values = [f"{100.0 * value:.2f}" for value in np.asarray(odds).tolist()]
        return cls(name, color, odds, values=values)

    def of_prints(self, deviations: ArrayLike | None) -> OddsBars:
        """With intervals that hold the odds of 95 % of the prints of a die; deviations: (k,)
        standard deviations among them, or None where they are not known."""
        if deviations is None:
            return self
        odds = np.asarray(self.odds, dtype=np.float64)[:, None]
        reach = _WITHIN * np.asarray(deviations, dtype=np.float64)[:, None] * [-1.0, 1.0]
        limits = np.clip(odds + reach, 0.0, 1.0)
        return replace(self, intervals=limits, interval_name="95 % of prints")


def odds_chart(
    labels: Sequence[str],
    kinds: Sequence[OddsBars],
    *,
    title: str,
    x_label: str,
    target: ArrayLike | None = None,
) -> Chart:
    """A group of bars for each outcome, perhaps in front of a wide one of its target. Values are
    written for at most 16 outcomes.

    labels: k outcomes, at least one.

    Raises InputError: there is no outcome, or not one of each probability for each.
    """
    counts = [len(np.asarray(kind.odds)) for kind in kinds]
    counts += [] if target is None else [len(np.asarray(target))]
    if not labels or set(counts) != {len(labels)}:
        raise InputError(
            "bars: expected at least one outcome, with one probability of each kind each, got "
            f"{len(labels)} labels and {', '.join(map(str, counts))} probabilities"
        )
    count, width = len(labels), _GROUP / len(kinds)
    places = np.arange(float(count))
    right = min(max(1200.0, 112.0 * count + 180.0), 1800.0) - 25.0
    box = (125.0, 105.0, right, 535.0)
    series: list[Series] = []
    notes: list[Note] = []
    most, room = 0.0, 0.0
    if target is not None:
        wanted = 100.0 * np.asarray(target, dtype=np.float64)
        most = float(wanted.max())
        series.append(Bars(places, wanted, _TARGET, PALE, "target", 0.55))
    for number, kind in enumerate(kinds):
        middles = places + (number - (len(kinds) - 1) / 2.0) * width
        above = percent = 100.0 * np.asarray(kind.odds, dtype=np.float64)
        series.append(Bars(middles, percent, width, kind.color, kind.name))
        if kind.intervals is not None:
            low, above = 100.0 * np.asarray(kind.intervals, dtype=np.float64).T
            series.append(Intervals(middles, low, above, kind.interval_name))
        most = max(most, float(percent.max()), float(above.max()))
        if kind.values and count <= _MOST_VALUES:
            wide = max(text_width(text, TINY) for text in kind.values)
            turned = wide + 10.0 > width * (right - box[0]) / (count + 0.2)
            room = max(room, wide + 14.0 if turned else 30.0)
            notes += [
                Note(text, x, y, (0.0, -8.0), "lm" if turned else "md", TINY, turned=turned)
                for text, x, y in zip(kind.values, middles, above, strict=True)
            ]
    if target is not None:
        series.append(Levels(places, wanted, _TARGET))
    tall = box[3] - box[1]
    # Wide enough for what is written above, too.
    wide = max(text_width(title, TITLE) + 120.0, legend_width(series, _LEGEND_COLUMNS) + 20.0)
    # Rows of the legend beyond the first push all below them down.
    lower = legend_height(series, _LEGEND_COLUMNS) - legend_height(series, len(series))
    return Chart(
        (box[0], box[1] + lower, max(right, wide), box[3] + lower),
        Axis(-0.6, count - 0.4, x_label, ticks=list(enumerate(labels))),
        Axis(0.0, max(most, 1e-9) * tall / (0.97 * tall - room), "probability (%)"),
        series,
        title,
        notes,
        grid="",
        legend=_LEGEND_COLUMNS,
    )
