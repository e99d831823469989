"""Odds of a die on a table beside what was asked of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from numpy.typing import ArrayLike

from dicedesign.report.charts.bar_chart import OddsBars, odds_chart
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.palette import ACCENT, FAINT
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.results.parts import SimulatedThrows, ThrownOdds
from dicedesign.throws.distances import total_variation

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["table_chart"]

_MODEL: Final = "#f0b88f"
"""Of what is predicted of throws, paler than what was thrown."""


def table_chart(
    labels: Sequence[str],
    target: ArrayLike,
    geometric: ArrayLike,
    thrown: ThrownOdds,
    deviations: ArrayLike | None = None,
) -> Chart:
    """Bars of each outcome's odds, in front of a wide one of its target: without momentum, by the
    momentum model and, where there were throws, simulated, with exact intervals.

    labels: k outcomes, at least one; target, geometric: (k,) probabilities in [0, 1]; deviations:
        (k,) standard deviations of the model's odds of prints, or None where they are not known.

    Raises InputError: there is no outcome, or not one of each probability for each.
    """
    kinds = [
        OddsBars("without momentum", FAINT, geometric),
        OddsBars("momentum model", _MODEL, thrown.momentum).of_prints(deviations),
    ]
    simulated = thrown.simulated
    if simulated is None:
        deviations = [f"{kind.name} {total_variation(kind.odds, target):.4f}" for kind in kinds]
        title = f"total variation to the target: {', '.join(deviations)}"
    else:
        title = _measured(simulated)
        kinds.append(
            OddsBars(
                "simulated throws",
                ACCENT,
                simulated.frequencies,
                simulated.intervals,
                "exact 95 % interval",
            )
        )
    return odds_chart(
        labels,
        kinds,
        title=title,
        x_label="outcome (label on the facet that the die rests on)",
        target=target,
    )


def _measured(simulated: SimulatedThrows) -> str:
    low, high = simulated.interval
    return (
        f"{simulated.drops:,} throws: total variation {simulated.total_variation:.4f} "
        f"(95 %: {low:.4f} to {high:.4f}), a perfect die: {simulated.noise_floor:.4f}"
    )


def _draw(die: FinishedDie) -> bytes:
    result = die.result
    assert result.thrown is not None
    deviations = None if result.tolerances is None else result.tolerances.deviations
    odds = result.target, result.probabilities, result.thrown, deviations
    return sheet([table_chart(result.labels, *odds)]).png()


FIGURES.register(
    Figure(
        name="table",
        line="odds on the table by each model beside the target",
        rank=10,
        title="Odds on the table",
        caption=(
            "The wide bar behind each outcome is its target. In front of it is how often the die "
            "would show it if it rolled without momentum, how often the momentum model expects it "
            "of it and of its prints, and, where throws were simulated, how often it came up, with "
            "the interval that chance allows."
        ),
        wanted=lambda die: die.result.thrown is not None,
        draw=_draw,
        instead_of="bars",
    )
)
