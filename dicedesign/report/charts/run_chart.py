"""Values along the course of one design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart
from dicedesign.report.charts.palette import ACCENT, FAINT
from dicedesign.report.charts.paper import BODY, NOTE
from dicedesign.report.charts.series import Curve, Note, Style
from dicedesign.results.result import Step

__all__ = ["Course", "run_chart"]

_MOST_MARKERS: Final = 60

_MOST_DECADES: Final = 18
"""Values this many powers of ten below the largest count as zero."""

_WIDE_RATIO: Final = 50.0
"""Of values to be drawn on a logarithmic axis, the largest to the smallest."""

_BOXES: Final = ((130.0, 65.0, 685.0, 485.0), (850.0, 65.0, 1410.0, 485.0))
"""Of charts beside each other."""


@dataclass(frozen=True)
class Course:
    """What values of a design are drawn against: its run time, or the numbers of its steps where
    there was no clock.

    history: accepted steps in the order of time, at least one, all with a time or none.

    Raises InputError: the history is empty.
    """

    history: Sequence[Step]

    def __post_init__(self) -> None:
        if not self.history:
            raise InputError("history: expected at least one step, got none")

    def place(self, step: Step) -> float:
        """Of a step along the axis."""
        return float(step.step) if step.seconds is None else step.seconds

    @property
    def name(self) -> str:
        """What it is, in words."""
        return "accepted steps" if self.history[0].seconds is None else "run time"

    def axis(self) -> Axis:
        """From the start to a little beyond the last step."""
        unit = "" if self.history[0].seconds is None else " (s)"
        end = max(self.place(step) for step in self.history)
        return Axis(0.0, 1.03 * max(end, 1e-3), f"{self.name}{unit}")


def run_chart(
    column: int,
    parts: Sequence[Sequence[tuple[float, float]]],
    course: Course,
    name: str,
    *,
    title: str,
    log: bool = True,
    levels: Mapping[str, float] | None = None,
) -> Chart:
    """Values along the course of one design.

    Values of zero are drawn at the lower end of a logarithmic axis, which is then marked 0.

    Parameters
    ----------
    column: place of the chart on its sheet, 0 or 1.
    parts: curves, each of n places on the course and values, at least 0; those without points are
        left out.
    name: of the values. title: above, before "against" the course.
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
    title = f"{title} against {course.name}"
    chart = Chart(_BOXES[column], course.axis(), y, title=title)
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
