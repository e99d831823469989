"""What the attempts at a concave die led to: displacement against odds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, draw_legend, legend_height, sheet
from dicedesign.report.charts.numbered_points import number_points
from dicedesign.report.charts.palette import ACCENT, DARK, DISTINCT, FAINT
from dicedesign.report.charts.paper import NOTE, Paper
from dicedesign.report.charts.series import Curve, Note, Style
from dicedesign.results.parts import Draft, Status, TradeOff

__all__ = ["trade_off_chart", "trade_off_figure"]

_LEAST: Final = 1e-9
"""Errors below are drawn as zero."""

_STYLES: Final = {
    None: Style(ACCENT, "", marker="o", size=7.0),
    Status.OFF_TARGET: Style(FAINT, "", marker="x", size=6.0),
    Status.SELF_INTERSECTING: Style(DISTINCT[4], "", marker="^", size=7.0),
    Status.TOO_NEAR: Style(DISTINCT[1], "", marker="s", size=6.0),
    Status.TIPPY: Style(DISTINCT[2], "", marker="D", size=6.0),
}
"""By what is worst of a draft."""


def trade_off_chart(trade_off: TradeOff, chosen: int | None, before: float) -> Chart:
    """A point for each draft: its error against its displacement, both better if smaller, marked by
    what is worst of it, beside the surface as it came.

    chosen: number of the attempt whose draft became the die, or None; before: error of the surface
    as it came.
    """
    drafts = trade_off.drafts
    errors = [trade_off.tolerance, before, *(draft.error for draft in drafts)]
    positive = [error for error in errors if error > _LEAST]
    low = min(positive) / 4.0
    y = Axis(
        low,
        max(positive) * 3.0,
        "error, max |p − q| or elsewhere",
        log=True,
        zero=len(positive) < len(errors),
    )
    farthest = max((100.0 * draft.displacement for draft in drafts), default=0.0)
    right = 1.08 * farthest or 1.0
    x = Axis(-0.03 * right, right, "mean displacement (% of the diagonal)")
    chart = Chart((130.0, 60.0, 1175.0, 645.0), x, y, title="smaller is better in both")
    level = trade_off.tolerance
    chart.series.append(Curve([x.low, x.high], [level, level], Style(FAINT, "--", 2.0)))
    wanted = f"tolerance {level:.2g}"
    chart.notes.append(Note(wanted, 0.99, level, (0.0, -6.0), "rd", NOTE, FAINT, inside=True))
    kept = [draft for draft in drafts if draft.attempt == chosen]
    if kept:
        ring = Style(DARK, "", marker="o", size=14.0, filled=False)
        chart.series.append(Curve(*_points(kept, low), ring, "this die"))
    original = Style(DARK, "", marker="*", size=7.0, filled=False)
    chart.series.append(Curve([0.0], [max(before, low)], original, "the surface as it came"))
    names = {
        None: "as wanted",
        Status.OFF_TARGET: "odds off",
        Status.SELF_INTERSECTING: "meets itself",
        Status.TOO_NEAR: f"outcomes nearer than {trade_off.apart_deg:g}°",
        Status.TIPPY: f"left at less than {trade_off.margin_deg:g}°",
    }
    worst = {draft.attempt: next(trade_off.flaws(draft), None) for draft in drafts}
    for status, name in names.items():
        group = [draft for draft in drafts if worst[draft.attempt] is status]
        if group:
            label = f"{name} ({len(group)})"
            chart.series.append(Curve(*_points(group, low), _STYLES[status], label))
    first = [*kept, *(draft for draft in drafts if draft.attempt != chosen)]
    numbers = [draft.attempt for draft in first]
    number_points(chart, zip(numbers, *_points(first, low), strict=True))
    return chart


def _points(drafts: Sequence[Draft], low: float) -> tuple[list[float], list[float]]:
    """Displacements in percent, and errors, at least `low`."""
    displacements = [100.0 * draft.displacement for draft in drafts]
    return displacements, [draft.error if draft.error > _LEAST else low for draft in drafts]


def trade_off_figure(trade_off: TradeOff, chosen: int | None, before: float) -> Paper:
    """`trade_off_chart` with its legend below."""
    chart = trade_off_chart(trade_off, chosen, before)
    paper = sheet([chart], below=110.0 + legend_height(chart.series, 3))
    place = paper.width / 2.0, chart.box[3] + 90.0
    draw_legend(paper, chart.series, place, columns=3)
    return paper
