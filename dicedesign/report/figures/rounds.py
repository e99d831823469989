"""Deviation from the target, round by round of simulated throws."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.palette import ACCENT, DARK, FAINT
from dicedesign.report.charts.series import Curve, Intervals, Series, Style
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.results.parts import ThrownOdds

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["rounds_chart"]


def rounds_chart(thrown: ThrownOdds) -> Chart:
    """Total variation from the target of the die of each round, against the throws so far: as its
    own throws show it, beside what a perfect die would show in as many, and as the throws of all
    rounds let one expect it, on the table and on what that may be instead.

    The verdict over the finished die, where there is one, comes last, with its interval of 95 %.

    Raises InputError: there is no round.
    """
    rounds, simulated = thrown.rounds, thrown.simulated
    if not rounds:
        raise InputError("rounds: expected at least one, got none")
    each = [entry.drops + entry.elsewhere_drops for entry in rounds]
    drops = np.cumsum(each, dtype=np.float64)
    deviations = [entry.deviation for entry in rounds]
    expected = [entry.expected for entry in rounds]
    elsewhere = [entry.elsewhere for entry in rounds if entry.elsewhere is not None]
    floors = [entry.noise_floor for entry in rounds]
    series: list[Series] = []
    heights = [*deviations, *expected, *elsewhere, *floors]
    if simulated is not None:
        drops = np.append(drops, drops[-1] + simulated.drops)
        floors.append(simulated.noise_floor)
        low, high = simulated.interval
        heights += [high, simulated.noise_floor]
        series += [
            Intervals(drops[-1:], [low], [high]),
            Curve(
                drops[-1:],
                [simulated.total_variation],
                Style(DARK, "", marker="D", size=7.0),
                "finished die, with its 95 % interval",
            ),
        ]
    thrown_at, kept = drops[: len(rounds)], [entry.is_kept for entry in rounds]
    series += [
        Curve(drops, floors, Style(FAINT, "--", 2.5, "o", 4.0), "a perfect die"),
        Curve(thrown_at, deviations, Style(FAINT, "", marker="o", size=7.0), "its throws"),
    ]
    if elsewhere:
        tables = "expected on nine of ten tables"
        series.append(Curve(thrown_at, elsewhere, Style("#e0ab8c", "-", 2.0, "^"), tables))
    series.append(Curve(thrown_at, expected, Style(ACCENT, marker="o", size=7.0), "expected"))
    best = np.array(expected)[kept]
    series.append(Curve(thrown_at[kept], best, Style(DARK, "", marker="o", size=3.0), "kept"))
    columns = 4
    return Chart(
        (145.0, 100.0 + 36.0 * (len(series) > columns + 1), 1235.0, 510.0),
        Axis(0.0, 1.05 * float(drops[-1]), "simulated throws so far"),
        Axis(0.0, 1.1 * max(heights), "total variation to the target"),
        series,
        "deviation from the target, round by round",
        legend=columns,
    )


def _draw(die: FinishedDie) -> bytes:
    assert die.result.thrown is not None
    return sheet([rounds_chart(die.result.thrown)]).png()


FIGURES.register(
    Figure(
        name="rounds",
        line="deviation from the target after each round of simulated throws",
        rank=12,
        title="Round by round",
        caption=(
            "After each round of simulated throws the die was designed anew, to make up for what "
            "was seen. A round's own throws show its die with as much of chance in it as a perfect "
            "die would show, the dashed line. What is expected of each die rests on the throws of "
            "all rounds; that with the least is kept. Triangles, if any, are what is expected on "
            "nine of ten tables that the table may be instead."
        ),
        wanted=lambda die: die.result.thrown is not None and len(die.result.thrown.rounds) > 0,
        draw=_draw,
    )
)
