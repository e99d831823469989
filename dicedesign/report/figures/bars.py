"""Target odds beside the achieved ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.report.charts.bar_chart import OddsBars, odds_chart
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.palette import ACCENT, PALE
from dicedesign.report.figures.figure import FIGURES, Figure

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["bars_chart"]


def bars_chart(
    labels: Sequence[str],
    target: ArrayLike,
    achieved: ArrayLike,
    deviations: ArrayLike | None = None,
) -> Chart:
    """A pair of bars for each outcome, with the values above them where they are few.

    labels: k outcomes, at least one; target, achieved: (k,) probabilities in [0, 1]; deviations:
        (k,) standard deviations of those of prints, or None where they are not known.

    Raises InputError: there is no outcome, or not one of each probability for each.
    """
    worst = float(np.abs(np.subtract(target, achieved)).max(initial=0.0))
    made = OddsBars.written("achieved", ACCENT, achieved).of_prints(deviations)
    return odds_chart(
        labels,
        [OddsBars.written("target", PALE, target), made],
        title=f"target and achieved odds, max |p − q| = {worst:.2g}",
        x_label="outcome (label on the facet that the body rests on)",
    )


def _draw(die: FinishedDie) -> bytes:
    result = die.result
    deviations = None if result.tolerances is None else result.tolerances.deviations
    chart = bars_chart(result.labels, result.target, result.probabilities, deviations)
    return sheet([chart]).png()


FIGURES.register(
    Figure(
        name="bars",
        line="target odds beside the achieved ones",
        rank=20,
        title="Target and achieved odds",
        caption=(
            "Probability that the die comes to rest on the facet with each label; the lines hold "
            "that of 95 % of its prints."
        ),
        wanted=lambda die: die.reshaped is None,
        draw=_draw,
    )
)
