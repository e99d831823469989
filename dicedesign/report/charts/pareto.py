"""Two measures of many dice against each other."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, draw_legend, sheet
from dicedesign.report.charts.numbered_points import number_points
from dicedesign.report.charts.palette import ACCENT, FAINT, PALE
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.series import Curve, Style
from dicedesign.runtime.arrays import Floats

__all__ = ["pareto_chart", "pareto_figure"]


def pareto_chart(
    trials: Sequence[Mapping[str, Any]], front: Collection[int], named: Sequence[int]
) -> Chart:
    """Smallest circle of each die of a search against its momentum margin.

    Parameters
    ----------
    trials: at least one, each with "number", "status" ("converged", or another where the die is not
        as wanted), "inradius_mm" and "margin_deg", at least 0, both None where there is nothing
        to measure; those are only counted.
    front: numbers of converged trials that no other beats in both; they are joined by steps.
    named: numbers of converged trials that are written beside their points, the first first; one
        that would cover an earlier one is left out.

    Raises
    ------
    InputError: there is no trial.
    """
    if not trials:
        raise InputError("trials: expected at least one, got none; run a trial")
    measured = [trial for trial in trials if trial["inradius_mm"] is not None]
    solved = [trial for trial in measured if trial["status"] == "converged"]
    missed = [trial for trial in measured if trial["status"] != "converged"]
    best = [trial for trial in solved if trial["number"] in front]
    beaten = [trial for trial in solved if trial["number"] not in front]
    radii, margins = _columns(measured)
    chart = Chart(
        (130.0, 60.0, 1175.0, 645.0),
        _axis(radii, "radius of the smallest inscribed circle (mm)"),
        _axis(margins, "momentum margin (°)"),
        title="larger is better in both",
    )
    if best:
        radii, margins = _columns(sorted(best, key=lambda trial: -trial["margin_deg"]))
        x, y = [chart.x.low, *radii.repeat(2)], [*margins.repeat(2), chart.y.low]
        chart.series.append(Curve(x, y, Style(ACCENT, width=2.5)))
    for group, label, style in (
        (missed, "not converged", Style(FAINT, "", marker="x", size=5.0)),
        (beaten, "converged", Style(PALE, "", marker="o", size=6.5)),
        (best, "Pareto front: no die beats it in both", Style(ACCENT, "", marker="o", size=6.5)),
    ):
        chart.series.append(Curve(*_columns(group), style, f"{label} ({len(group)})"))
    if len(trials) > len(measured):
        unknown = f"nothing to measure ({len(trials) - len(measured)})"
        chart.series.append(Curve([], [], Style(line=""), unknown))
    by_number = {trial["number"]: trial for trial in solved}
    radii, margins = _columns([by_number[number] for number in named])
    number_points(chart, zip(named, radii.tolist(), margins.tolist(), strict=True))
    return chart


def pareto_figure(
    trials: Sequence[Mapping[str, Any]], front: Collection[int], named: Sequence[int]
) -> Paper:
    """`pareto_chart` with its legend below."""
    chart = pareto_chart(trials, front, named)
    paper = sheet([chart], below=150.0)
    draw_legend(paper, chart.series, (paper.width / 2.0, paper.height - 70.0), columns=3)
    return paper


def _columns(trials: Sequence[Mapping[str, Any]]) -> tuple[Floats, Floats]:
    """Radii and margins."""
    return (
        np.array([float(trial["inradius_mm"]) for trial in trials]),
        np.array([float(trial["margin_deg"]) for trial in trials]),
    )


def _axis(values: Floats, label: str) -> Axis:
    if len(values) == 0:
        return Axis(0.0, 1.0, label)
    low, high = float(values.min()), float(values.max())
    room = 0.08 * (high - low) if high > low else 0.1 * max(high, 1.0)
    return Axis(max(low - room, 0.0), high + room, label)
