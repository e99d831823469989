"""Numbers beside points of a chart."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from dicedesign.report.charts.chart import Chart
from dicedesign.report.charts.paper import NOTE
from dicedesign.report.charts.series import Note
from dicedesign.runtime.arrays import Floats

__all__ = ["number_points"]

_ROOM: Final = np.array([37.0, 21.0])
"""For a number, in pixels."""


def number_points(chart: Chart, points: Iterable[tuple[int, float, float]]) -> None:
    """Write numbers beside points of a chart, each a number, x and y, the first first; one that
    would cover an earlier one is left out."""
    written: list[Floats] = []
    for number, x, y in points:
        place = chart.places([x], [y])[0]
        if not any((np.abs(place - other) < _ROOM).all() for other in written):
            written.append(place)
            chart.notes.append(Note(str(number), x, y, (10.0, -8.0), "ld", NOTE))
