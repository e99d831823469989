"""Values against the run time of one design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart
from dicedesign.report.charts.palette import ACCENT, FAINT
from dicedesign.report.charts.paper import BODY, NOTE
from dicedesign.report.charts.series import Curve, Note, Style

__all__ = ["run_chart"]

_MOST_MARKERS: Final = 60

_MOST_DECADES: Final = 18
"""Values this many powers of ten below the largest count as zero."""

_WIDE_RATIO: Final = 50.0
"""Of values to be drawn on a logarithmic axis, the largest to the smallest."""

_BOXES: Final = ((130.0, 65.0, 685.0, 485.0), (850.0, 65.0, 1410.0, 485.0))
"""Of charts beside each other."""


def run_chart(
    column: int,
    parts: Sequence[Sequence[tuple[float, float]]],
    end: float,
    name: str,
    *,
    title: str,
    log: bool = True,
    levels: Mapping[str, float] | None = None,
) -> Chart:
    """Values against the run time of one design.

    Values of zero are drawn at the lower end of a logarithmic axis, which is then marked 0.

    Parameters
    ----------
    column: place of the chart on its sheet, 0 or 1.
    parts: curves, each of n seconds and values, at least 0; those without points are left out.
    end: last second.
    name: of the values. title: above.
    log: whether the axis is logarithmic in any case; otherwise where values differ widely.
    levels: names and values of dashed lines across the chart, above 0.
    """
    levels = levels or {}
    curves = [(np.array(part)[:, 0], np.array(part)[:, 1]) for part in parts if part]
    values = np.concatenate([np.zeros(0), *(y for _, y in curves), list(levels.values())])
    largest = float(values.max(initial=0.0)) or 1.0
    positive = values[values > largest * 10.0**-_MOST_DECADES]
    lowest = float(positive.min(initial=largest))
    log = log or bool(len(positive) == len(values) and largest > _WIDE_RATIO * lowest)
    if log:
        y = Axis(lowest / 5.0, largest * 3.0, name, log=True, zero=len(positive) < len(values))
        curves = [(x, np.where(part >= lowest, part, y.low)) for x, part in curves]
    else:
        room = 0.05 * (largest - float(values.min())) or 0.05 * largest
        y = Axis(float(values.min()) - room, largest + room, name)
    few = sum(len(x) for x, _ in curves) <= _MOST_MARKERS
    chart = Chart(_BOXES[column], Axis(0.0, 1.03 * max(end, 1e-3), "run time (s)"), y, title=title)
    for text, level in levels.items():
        ends = [chart.x.low, chart.x.high]
        chart.series.append(Curve(ends, [level, level], Style(FAINT, "--", 2.0)))
        chart.notes.append(Note(text, 0.0, level, (8.0, 6.0), "la", NOTE, FAINT, inside=True))
    for x, part in curves:
        style = Style(ACCENT, marker="o" if few or len(x) == 1 else "")
        chart.series.append(Curve(x, part, style))
    if not curves:
        middle = float(np.sqrt(y.low * y.high))
        chart.notes.append(Note("not known", 0.5, middle, size=BODY, color=FAINT, inside=True))
    return chart
