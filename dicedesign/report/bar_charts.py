"""Probabilities of outcomes as bars beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.report.palette import ACCENT, DARK, FAINT, PALE
from dicedesign.report.sheet import SMALL, TINY, Sheet, text_width, with_style
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.distances import total_variation
from dicedesign.throws.goodness_of_fit import RollVerdict

MODEL: Final = "#f0b88f"
"""Of what is predicted of throws, paler than what was thrown."""

MOST_VALUES: Final = 16
"""Outcomes above whose bars values are written."""

WITHIN: Final = 1.96
"""Standard deviations about the mean that hold 95 % of what is normal."""

LIMITS: Final[dict[str, Any]] = {"ecolor": DARK, "elinewidth": 2.0, "capsize": 6, "capthick": 2.0}


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
    values: written above the bars, k texts, or none; by default the probabilities in percent.
    """

    name: str
    color: str
    probabilities: ArrayLike
    intervals: ArrayLike | None = None
    interval_name: str = "95 % of prints"
    values: Sequence[str] | None = None


def intervals_of_prints(probabilities: ArrayLike, deviations: ArrayLike) -> Floats:
    """(k, 2) limits that hold the probabilities (k,) of 95 % of the prints of a die, from the
    standard deviations (k,) among them."""
    reach = WITHIN * np.asarray(deviations, dtype=np.float64)[:, None] * [-1.0, 1.0]
    return np.clip(np.asarray(probabilities)[:, None] + reach, 0.0, 1.0)


@with_style
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
    count, width = len(labels), 0.8 / len(kinds)
    places = np.arange(float(count))
    right = min(max(1200.0, 112.0 * count + 180.0), 1800.0) - 25.0
    spacing = (right - 125.0) / (count + 0.2)
    sheet = Sheet(right + 25.0, 625.0, grows=True) if sheet is None else sheet
    axes = sheet.axes(125.0, 105.0, right, 535.0)
    room = 0.0
    if target is not None:
        wanted = 100.0 * np.asarray(target, dtype=np.float64)
        axes.bar(places, wanted, 0.92, color=PALE, alpha=0.55, label="target")
        axes.hlines(wanted, places - 0.46, places + 0.46, color=DARK, linewidth=3.0, zorder=3.0)
    for number, kind in enumerate(kinds):
        percent = 100.0 * np.asarray(kind.probabilities, dtype=np.float64)
        middles = places + (number - (len(kinds) - 1) / 2.0) * width
        bars = axes.bar(middles, percent, width, color=kind.color, label=kind.name)
        if kind.intervals is not None:
            ends = np.abs(100.0 * np.asarray(kind.intervals, dtype=np.float64).T - percent)
            name = kind.interval_name
            bars.errorbar = axes.errorbar(middles, percent, ends, fmt="none", label=name, **LIMITS)
        values = [f"{p:.2f}" for p in percent] if kind.values is None else kind.values
        if values and count <= MOST_VALUES:
            widest = max(text_width(text, TINY) for text in values)
            is_turned = widest + 10.0 > width * spacing
            room = max(room, widest + 16.0 if is_turned else 30.0)
            axes.bar_label(bars, values, padding=7.0, size=TINY, rotation=90.0 * is_turned)
    # Above the highest bar there is room for its value.
    highest = max(axes.dataLim.y1, 1e-7)
    axes.set(xlim=(-0.6, count - 0.4), ylim=(0.0, highest * 430.0 / (0.97 * 430.0 - room)))
    axes.set(xlabel=x_label, ylabel="probability (%)")
    # Long labels are turned.
    is_wide = max(text_width(text, SMALL) for text in labels) + 6.0 > spacing
    axes.set_xticks(places, labels, size=SMALL, rotation=90.0 * is_wide)
    put_legend_above(axes, title, 5)
    return sheet


def put_legend_above(axes: Axes, title: str, columns: int) -> None:
    """Write the legend above axes, and a title above that."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=columns)
    rows = -(-len(axes.get_legend_handles_labels()[0]) // columns)
    axes.set_title(title, pad=26.0 + 30.0 * rows)


def bars_chart(die: FinishedDie) -> Sheet:
    """A pair of bars for each outcome: its target, and what was achieved."""
    result = die.result
    probabilities = result.probabilities
    worst = float(np.abs(np.subtract(result.target, probabilities)).max(initial=0.0))
    return outcome_chart(
        result.labels,
        [
            Bars("target", PALE, result.target),
            Bars("achieved", ACCENT, probabilities, _prints_of(result, probabilities)),
        ],
        title=f"target and achieved probabilities, max |p − q| = {worst:.2g}",
        x_label="outcome (label on the facet that the body rests on)",
    )


def _prints_of(result: Result, probabilities: ArrayLike) -> Floats | None:
    """Limits (k, 2) of 95 % of the prints of a die about probabilities (k,), where they are
    known."""
    tolerances = result.tolerances
    return None if tolerances is None else intervals_of_prints(probabilities, tolerances.deviations)


def before_after_chart(die: FinishedDie) -> Sheet:
    """A pair of bars in front of its target for each outcome, before and after a surface was made
    into a die, and one for all rests that belong to no outcome."""
    result, concave = die.result, die.result.concave
    assert concave is not None
    before, after = np.array(concave.probabilities_before), np.array(result.probabilities)
    errors = [
        np.abs(probabilities - result.target).max(initial=0.0) for probabilities in (before, after)
    ]
    return outcome_chart(
        [*result.labels, "elsewhere"],
        [
            Bars("before", FAINT, [*before, concave.elsewhere_before]),
            Bars("after", ACCENT, [*after, result.elsewhere]),
        ],
        title=f"max |p − q| = {errors[0]:.2g} before, {errors[1]:.2g} after",
        x_label="outcome that the body comes to rest on",
        target=[*result.target, 0.0],
    )


def table_chart(die: FinishedDie) -> Sheet:
    """Bars of each outcome's probabilities, in front of a wide one of its target: without momentum,
    by the momentum model and, where there were throws, simulated, with exact intervals."""
    result, thrown = die.result, die.result.thrown
    assert thrown is not None
    kinds = {
        "without momentum": (FAINT, result.probabilities, None),
        "momentum model": (MODEL, thrown.momentum, _prints_of(result, thrown.momentum)),
    }
    bars = [Bars(name, *kind, values=()) for name, kind in kinds.items()]
    simulated = thrown.simulated
    if simulated is None:
        far = {
            name: total_variation(probabilities, result.target)
            for name, (_, probabilities, _) in kinds.items()
        }
        each = [f"{name} {variation:.4f}" for name, variation in far.items()]
        title = f"total variation to the target: {', '.join(each)}"
    else:
        low, high = simulated.interval
        title = (
            f"{simulated.drops:,} throws: total variation {simulated.total_variation:.4f} "
            f"(95 %: {low:.4f} to {high:.4f}), a perfect die: {simulated.noise_floor:.4f}"
        )
        frequencies, limits = simulated.frequencies, simulated.intervals
        caption = "exact 95 % interval"
        bars.append(Bars("simulated throws", ACCENT, frequencies, limits, caption, ()))
    return outcome_chart(
        result.labels,
        bars,
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
    if len(labels) != len(verdict.probabilities):
        raise InputError(
            f"rolls: expected {len(verdict.probabilities)} labels, one for each outcome, got "
            f"{len(labels)}"
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
        [Bars("probabilities tested", PALE, verdict.probabilities, values=()), thrown],
        title=(
            f"{verdict.throws} throws: p = {verdict.p_value:.2g}, total variation "
            f"{variation.value:.3f} (a perfect die: {variation.noise_floor:.3f})"
        ),
        x_label="outcome, with its count above",
    )
