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
from dicedesign.results.throws import ThrownOdds

if TYPE_CHECKING:
    from dicedesign.fabricate.finished_die import FinishedDie

__all__ = ["rounds_chart"]


def rounds_chart(thrown: ThrownOdds) -> Chart:
    """Total variation between simulated frequencies and the target, round by round, against the
    throws onto the table so far, with what a perfect die would show in as many as the round has.

    The first rounds may have throws onto other tables too, half as many onto each.

    The verdict over the finished die, where there is one, comes last, with its interval of 95 %.

    Raises InputError: there is no round.
    """
    rounds, simulated = thrown.rounds, thrown.simulated
    if not rounds:
        raise InputError("rounds: expected at least one, got none")
    drops = np.cumsum([entry.drops for entry in rounds], dtype=np.float64)
    deviations = [entry.deviation for entry in rounds]
    floors = [entry.noise_floor for entry in rounds]
    series: list[Series] = []
    changed = [entry.changed for entry in rounds if entry.changed]
    heights = [*deviations, *floors, *(value for pair in changed for value in pair)]
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
    series.append(Curve(drops, floors, Style(FAINT, "--", 2.5, "o", 4.0), "a perfect die"))
    series += [
        Curve(
            drops[: len(changed)],
            list(of_table),
            Style("#e0ab8c", "-", 2.0, "^"),
            "" if number else "on other tables",
        )
        for number, of_table in enumerate(zip(*changed, strict=True))
    ]
    series.append(
        Curve(
            drops[: len(rounds)],
            deviations,
            Style(ACCENT, marker="o", size=7.0),
            "die of the round",
        )
    )
    columns = 4
    return Chart(
        (145.0, 100.0 + 36.0 * (sum(bool(one.label) for one in series) > columns), 1235.0, 510.0),
        Axis(0.0, 1.05 * float(drops[-1]), "simulated throws onto the table so far"),
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
            "was seen. The dashed line is what a perfect die would show by chance in as many "
            "throws. Triangles, if any, are half as many throws onto each of some other tables, "
            "where it is meant to have nearly the same odds."
        ),
        wanted=lambda die: die.result.thrown is not None and len(die.result.thrown.rounds) > 0,
        draw=_draw,
    )
)
