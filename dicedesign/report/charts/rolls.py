"""Frequencies of a die's throws beside its odds."""

from __future__ import annotations

from collections.abc import Sequence

from dicedesign.errors import InputError
from dicedesign.report.charts.bar_chart import OddsBars, odds_chart
from dicedesign.report.charts.chart import Chart
from dicedesign.report.charts.palette import ACCENT, PALE
from dicedesign.throws.roll_verdict import RollVerdict

__all__ = ["rolls_chart"]


def rolls_chart(labels: Sequence[str], verdict: RollVerdict) -> Chart:
    """A pair of bars for each outcome, with the exact interval of its probability, and above the
    bars of at most 16 outcomes their counts.

    labels: k outcomes, as many as the verdict has.

    Raises InputError: there is not one label for each outcome.
    """
    if len(labels) != len(verdict.odds):
        raise InputError(
            f"rolls: expected {len(verdict.odds)} labels, one for each outcome, got {len(labels)}"
        )
    variation = verdict.variation
    thrown = OddsBars(
        "thrown",
        ACCENT,
        verdict.frequencies,
        verdict.intervals,
        f"exact {100 * verdict.confidence:g} % interval",
        [str(count) for count in verdict.counts],
    )
    return odds_chart(
        labels,
        [OddsBars("odds tested", PALE, verdict.odds), thrown],
        title=(
            f"{verdict.throws} throws: p = {verdict.p_value:.2g}, total variation "
            f"{variation.value:.3f} (a perfect die: {variation.noise_floor:.3f})"
        ),
        x_label="outcome",
    )
