"""Probabilities of outcomes as bars beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.report.palette import ACCENT, DARK, FAINT, PALE
from dicedesign.report.sheet import SMALL, TINY, Sheet, styled, text_width
from dicedesign.throws.distances import total_variation
from dicedesign.throws.goodness_of_fit import RollVerdict

MODEL: Final = "#f0b88f"
"""Of what is predicted of throws, paler than what was thrown."""

MOST_VALUES: Final = 16
"""Outcomes above whose bars values are written."""

GROUP_WIDTH: Final = 0.8
"""Of the bars of one outcome, over the distance of outcomes."""

TARGET_WIDTH: Final = 0.92
"""The same, of the wide bar behind them."""

LEGEND_COLUMNS: Final = 5

WITHIN: Final = 1.96
"""Standard deviations about the mean that hold 95 % of what is normal."""


@dataclass(frozen=True)
class Bars:
    """One kind of probabilities.

    Attributes
    ----------
    name: in the legend.
    color: of the bars.
    probabilities: (k,) in [0, 1].
    intervals: (k, 2) limits drawn around them, or None.
    interval_name: in the legend.
    values: written above the bars, k texts, or empty for none.
    """

    name: str
    color: str
    probabilities: ArrayLike
    intervals: ArrayLike | None = None
    interval_name: str = ""
    values: Sequence[str] = ()

    @classmethod
    def written(cls, name: str, color: str, probabilities: ArrayLike) -> Bars:
        """With percentages above them."""
        values = [f"{100.0 * value:.2f}" for value in np.asarray(probabilities).tolist()]
        return cls(name, color, probabilities, values=values)

    def of_prints(self, deviations: ArrayLike | None) -> Bars:
        """With intervals that hold the probabilities of 95 % of the prints of a die; deviations:
        (k,) standard deviations among them, or None where they are not known."""
        if deviations is None:
            return self
        middles = np.asarray(self.probabilities, dtype=np.float64)[:, None]
        reach = WITHIN * np.asarray(deviations, dtype=np.float64)[:, None] * [-1.0, 1.0]
        limits = np.clip(middles + reach, 0.0, 1.0)
        return replace(self, intervals=limits, interval_name="95 % of prints")


@styled
def outcome_chart(
    labels: Sequence[str],
    kinds: Sequence[Bars],
    *,
    title: str,
    x_label: str,
    target: ArrayLike | None = None,
    sheet: Sheet | None = None,
) -> Sheet:
    """A group of bars for each outcome, perhaps in front of a wide one of its target. Values are
    written for at most 16 outcomes.

    labels: k outcomes, at least one; sheet: to draw on its upper end, or None for a new one.

    Raises InputError: there is no outcome, or not one of each probability for each.
    """
    counts = [len(np.asarray(kind.probabilities)) for kind in kinds]
    counts += [] if target is None else [len(np.asarray(target))]
    if not labels or set(counts) != {len(labels)}:
        raise InputError(
            "bars: expected at least one outcome, with one probability of each kind each, got "
            f"{len(labels)} labels and {', '.join(map(str, counts))} probabilities"
        )
    count, width = len(labels), GROUP_WIDTH / len(kinds)
    places = np.arange(float(count))
    right = min(max(1200.0, 112.0 * count + 180.0), 1800.0) - 25.0
    top, bottom = 105.0, 535.0
    spacing = (right - 125.0) / (count + 0.2)
    sheet = Sheet(right + 25.0, bottom + 90.0, grows=True) if sheet is None else sheet
    axes = sheet.axes(125.0, top, right, bottom)
    highest, room = 1e-7, 0.0
    if target is not None:
        wanted = 100.0 * np.asarray(target, dtype=np.float64)
        highest = max(highest, float(wanted.max()))
        axes.bar(places, wanted, TARGET_WIDTH, color=PALE, alpha=0.55, label="target")
    for number, kind in enumerate(kinds):
        middles = places + (number - (len(kinds) - 1) / 2.0) * width
        ends = percent = 100.0 * np.asarray(kind.probabilities, dtype=np.float64)
        axes.bar(middles, percent, width, color=kind.color, label=kind.name)
        if kind.intervals is not None:
            low, ends = 100.0 * np.asarray(kind.intervals, dtype=np.float64).T
            line: dict[str, Any] = {"fmt": "none", "ecolor": DARK, "elinewidth": 2.0, "capsize": 6}
            half = (ends - low) / 2.0
            axes.errorbar(middles, low + half, half, label=kind.interval_name, capthick=2.0, **line)
        highest = max(highest, float(percent.max()), float(ends.max()))
        if kind.values and count <= MOST_VALUES:
            widest = max(text_width(text, TINY) for text in kind.values)
            is_turned = widest + 10.0 > width * spacing
            room = max(room, widest + 16.0 if is_turned else 30.0)
            for text, x, y in zip(kind.values, middles, ends, strict=True):
                axes.annotate(
                    text,
                    (x, y),
                    (0.0, 7.0),
                    textcoords="offset points",
                    size=TINY,
                    ha="center",
                    va="bottom",
                    rotation=90.0 if is_turned else 0.0,
                )
    if target is not None:
        half_width = TARGET_WIDTH / 2.0
        axes.hlines(wanted, places - half_width, places + half_width, color=DARK, linewidth=3.0)
    tall = bottom - top
    axes.set(xlim=(-0.6, count - 0.4), ylim=(0.0, highest * tall / (0.97 * tall - room)))
    axes.set(xlabel=x_label, ylabel="probability (%)")
    widest = max(text_width(text, SMALL) for text in labels)
    size = SMALL if widest < spacing - 6.0 else TINY
    axes.set_xticks(places, labels, size=size)
    if size / SMALL * widest > spacing - 6.0:
        axes.tick_params("x", rotation=90.0)
    entries = len(axes.get_legend_handles_labels()[0])
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=LEGEND_COLUMNS)
    axes.set_title(title, pad=26.0 + 30.0 * -(-entries // LEGEND_COLUMNS))
    return sheet


def bars_chart(die: FinishedDie) -> Sheet:
    """A pair of bars for each outcome: its target, and what was achieved."""
    result = die.result
    deviations = None if result.tolerances is None else result.tolerances.deviations
    worst = float(np.abs(np.subtract(result.target, result.probabilities)).max(initial=0.0))
    achieved = Bars.written("achieved", ACCENT, result.probabilities).of_prints(deviations)
    return outcome_chart(
        result.labels,
        [Bars.written("target", PALE, result.target), achieved],
        title=f"target and achieved odds, max |p − q| = {worst:.2g}",
        x_label="outcome (label on the facet that the body rests on)",
    )


def before_after_chart(die: FinishedDie) -> Sheet:
    """A pair of bars in front of its target for each outcome, before and after a surface was made
    into a die, and one for all rests that belong to no outcome."""
    result = die.result
    assert result.concave is not None
    concave = result.concave
    kinds, errors = [], []
    for name, color, probabilities, elsewhere in (
        ("before", FAINT, concave.probabilities_before, concave.elsewhere_before),
        ("after", ACCENT, result.probabilities, result.elsewhere),
    ):
        errors.append(np.abs(np.subtract(probabilities, result.target)).max(initial=0.0))
        kinds.append(Bars.written(name, color, [*probabilities, elsewhere]))
    return outcome_chart(
        [*result.labels, "elsewhere"],
        kinds,
        title=f"max |p − q| = {errors[0]:.2g} before, {errors[1]:.2g} after",
        x_label="outcome that the body comes to rest on",
        target=[*result.target, 0.0],
    )


def table_chart(die: FinishedDie) -> Sheet:
    """Bars of each outcome's probabilities, in front of a wide one of its target: without momentum,
    by the momentum model and, where there were throws, simulated, with exact intervals."""
    result, thrown = die.result, die.result.thrown
    assert thrown is not None
    deviations = None if result.tolerances is None else result.tolerances.deviations
    kinds = [
        Bars("without momentum", FAINT, result.probabilities),
        Bars("momentum model", MODEL, thrown.momentum).of_prints(deviations),
    ]
    simulated = thrown.simulated
    if simulated is None:
        each = [
            f"{kind.name} {total_variation(kind.probabilities, result.target):.4f}"
            for kind in kinds
        ]
        title = f"total variation to the target: {', '.join(each)}"
    else:
        low, high = simulated.interval
        title = (
            f"{simulated.drops:,} throws: total variation {simulated.total_variation:.4f} "
            f"(95 %: {low:.4f} to {high:.4f}), a perfect die: {simulated.noise_floor:.4f}"
        )
        frequencies, intervals = simulated.frequencies, simulated.intervals
        limits = "exact 95 % interval"
        kinds.append(Bars("simulated throws", ACCENT, frequencies, intervals, limits))
    return outcome_chart(
        result.labels,
        kinds,
        title=title,
        x_label="outcome (label on the facet that the die rests on)",
        target=result.target,
    )


def rolls_chart(labels: Sequence[str], verdict: RollVerdict) -> Sheet:
    """A pair of bars for each outcome: what was tested, and the frequency of a die's throws, with
    the exact interval of its probability, and above the bars of at most 16 outcomes their counts.

    labels: k outcomes, as many as the verdict has.

    Raises InputError: there is not one label for each outcome.
    """
    if len(labels) != len(verdict.odds):
        raise InputError(
            f"rolls: expected {len(verdict.odds)} labels, one for each outcome, got {len(labels)}"
        )
    variation = verdict.variation
    thrown = Bars(
        "thrown",
        ACCENT,
        verdict.frequencies,
        verdict.intervals,
        f"exact {100 * verdict.confidence:g} % interval",
        [str(count) for count in verdict.counts],
    )
    return outcome_chart(
        labels,
        [Bars("odds tested", PALE, verdict.odds), thrown],
        title=(
            f"{verdict.throws} throws: p = {verdict.p_value:.2g}, total variation "
            f"{variation.value:.3f} (a perfect die: {variation.noise_floor:.3f})"
        ),
        x_label="outcome",
    )
