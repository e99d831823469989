"""Dice that are designed for throws, in one figure: before, after and on changed tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dicedesign.bench.measures.thrown_dice import Extent
from dicedesign.bench.measures.thrown_rows import ThrownRow
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.report.charts.chart import Chart
    from dicedesign.report.charts.paper import Paper
    from dicedesign.report.charts.series import Series

__all__ = ["thrown_chart", "thrown_figure"]

HALF_MARK = 0.28
"""Of a noise floor, over the distance of two rows."""

CHANGES_BELOW = 0.2
"""Of the dots of changed tables, over the same."""


def thrown_chart(rows: Sequence[ThrownRow], extent: Extent) -> Chart:
    """Total variation from the target of each die, on one line.

    Raises InputError: no die was thrown.
    """
    from dicedesign.report.charts.axes import Axis
    from dicedesign.report.charts.chart import Chart
    from dicedesign.report.charts.palette import ACCENT, DARK, FAINT, PALE
    from dicedesign.report.charts.series import Curve, Style

    thrown = [row for row in rows if row.after is not None]
    if not thrown:
        raise InputError("dice: expected at least one that was thrown, got none; see the notes")
    before, after = (Style(color, "", marker="o", size=7.5) for color in (PALE, ACCENT))
    changed_label = (
        f"for throws, a parameter ±{100.0 * extent.variation:g} % "
        f"({extent.variation_drops:,} drops)"
    )
    series: list[Series] = []
    largest = 0.0
    for line, row in zip(range(len(thrown) - 1, -1, -1), thrown, strict=True):
        assert row.after is not None
        reached = row.after.to_target
        level = [line, line]
        if row.before is not None:
            start = row.before.to_target.value
            series.append(Curve([start, reached.value], level, Style(PALE)))
            series.append(Curve([start], [line], before, "without momentum"))
            largest = max(largest, start)
        changed = [change.to_target.value for change in row.changes]
        heights = [line - CHANGES_BELOW] * len(changed)
        series += [
            Curve(changed, heights, Style(FAINT, "", marker="o", size=3.0), changed_label),
            Curve(reached.interval, level, Style("#e0ab8c", width=5.5)),
            Curve([reached.value], [line], after, "for throws, 95 % interval"),
            Curve(
                [reached.noise_floor] * 2,
                [line - HALF_MARK, line + HALF_MARK],
                Style(DARK, width=2.5),
                "mean of a perfect die",
            ),
        ]
        largest = max(largest, reached.value, reached.interval[1], reached.noise_floor, *changed)
    names = [(float(k), row.name) for k, row in enumerate(reversed(thrown))]
    return Chart(
        (250.0, 60.0, 1230.0, 60.0 + 82.0 * len(thrown)),
        Axis(0.0, 1.05 * largest, "total variation from the target"),
        Axis(-0.6, len(thrown) - 0.4, ticks=names),
        series,
        f"{extent.drops:,} throws of each die, before and after",
        grid="x",
    )


def thrown_figure(rows: Sequence[ThrownRow], extent: Extent) -> Paper:
    """`thrown_chart` with its legend below. Raises InputError: as that."""
    from dicedesign.report.charts.chart import draw_legend, sheet

    chart = thrown_chart(rows, extent)
    paper = sheet([chart], below=180.0)
    draw_legend(paper, chart.series, (paper.width / 2.0, paper.height - 90.0), columns=2)
    return paper
