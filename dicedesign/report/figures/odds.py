"""Odds before and after a surface was made into a die, beside the target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.report.charts.bar_chart import OddsBars, odds_chart
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.palette import ACCENT, FAINT
from dicedesign.report.figures.figure import FIGURES, Figure

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["before_after_chart"]


def before_after_chart(
    labels: Sequence[str],
    target: ArrayLike,
    before: ArrayLike,
    after: ArrayLike,
    elsewhere: tuple[float, float],
) -> Chart:
    """A pair of bars in front of its target for each outcome, and one for all other rests.

    Parameters
    ----------
    labels: k outcomes, at least one.
    target, before, after: (k,) probabilities in [0, 1].
    elsewhere: probability in [0, 1] of all rests that belong to no outcome, before and after.

    Raises
    ------
    InputError: there is no outcome, or not one of each probability for each.
    """
    errors = [np.abs(np.subtract(odds, target)).max(initial=0.0) for odds in (before, after)]
    kinds = [
        OddsBars.written(name, color, np.append(odds, others))
        for name, color, odds, others in zip(
            ("before", "after"), (FAINT, ACCENT), (before, after), elsewhere, strict=True
        )
    ]
    return odds_chart(
        [*labels, "elsewhere"],
        kinds,
        title=f"max |p − q| = {errors[0]:.2g} before, {errors[1]:.2g} after",
        x_label="outcome that the body comes to rest on",
        target=np.append(target, 0.0),
    )


def _draw(die: FinishedDie) -> bytes:
    result = die.result
    assert result.concave is not None
    chart = before_after_chart(
        result.labels,
        result.target,
        result.concave.probabilities_before,
        result.probabilities,
        (result.concave.elsewhere_before, result.elsewhere),
    )
    return sheet([chart]).png()


FIGURES.register(
    Figure(
        name="odds",
        line="odds before and after the surface was made into a die",
        rank=20,
        title="Odds before and after",
        caption=(
            "Probability that the body comes to rest on each outcome, and on any other side "
            "(elsewhere), before and after it was made into a die. The wide bar behind each "
            "outcome is its target."
        ),
        wanted=lambda die: die.result.concave is not None,
        draw=_draw,
    )
)
