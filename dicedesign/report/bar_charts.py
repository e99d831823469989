"""Bar charts of the probabilities of outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.palette import ACCENT, DARK, FAINT, PALE
from dicedesign.report.sheet import SMALL, TINY, Sheet, text_width, with_style
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.distances import total_variation
from dicedesign.throws.goodness_of_fit import RollVerdict

MODEL = "#f0b88f"
"""Color of predictions, paler than the color of throws."""

MAX_WITH_VALUES = 16
"""Most outcomes for which values are written above the bars."""

DEVIATIONS_95 = 1.96
"""Half-width of the 95 % interval of a normal distribution, in standard deviations."""

LIMITS: dict[str, Any] = {"ecolor": DARK, "elinewidth": 2.0, "capsize": 6, "capthick": 2.0}


@dataclass(frozen=True)
class Bars:
    """Series of bars.

    Attributes
    ----------
    name, color: name in the legend, and color of the bars.
    probabilities: (k,) in [0, 1].
    intervals: (k, 2) limits of error bars, or None.
    interval_name: name of the error bars in the legend.
    values: k texts above the bars, or an empty sequence; None for the probabilities in percent.
    """

    name: str
    color: str
    probabilities: ArrayLike
    intervals: ArrayLike | None = None
    interval_name: str = "95 % of prints"
    values: Sequence[str] | None = None


def intervals_of_prints(probabilities: ArrayLike, deviations: ArrayLike) -> Floats:
    """95 % intervals (k, 2) of the probabilities of the prints of a die.

    probabilities, deviations: means and standard deviations (k,) over the prints.
    """
    reach = DEVIATIONS_95 * np.asarray(deviations, dtype=np.float64)[:, None] * [-1.0, 1.0]
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
    """Group of bars for each outcome, in front of a wide bar of its target if there is one.

    Values are written for at most 16 outcomes.

    labels: k outcomes, at least one; target: (k,) or None; sheet: a sheet to draw on, at its upper
    end, or None for a new one.

    Raises InputError: there is no outcome, or a series has not one probability for each.
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
        if values and count <= MAX_WITH_VALUES:
            widest = max(text_width(text, TINY) for text in values)
            is_turned = widest + 10.0 > width * spacing
            room = max(room, widest + 16.0 if is_turned else 30.0)
            axes.bar_label(bars, values, padding=7.0, size=TINY, rotation=90.0 * is_turned)
    # Leave room for the value above the highest bar.
    highest = max(axes.dataLim.y1, 1e-7)
    axes.set(xlim=(-0.6, count - 0.4), ylim=(0.0, highest * 430.0 / (0.97 * 430.0 - room)))
    axes.set(xlabel=x_label, ylabel="probability (%)")
    # Long labels are turned.
    is_wide = max(text_width(text, SMALL) for text in labels) + 6.0 > spacing
    axes.set_xticks(places, labels, size=SMALL, rotation=90.0 * is_wide)
    put_legend_above(axes, title, 5)
    return sheet


def put_legend_above(axes: Axes, title: str, columns: int) -> None:
    """Add a legend above axes, and a title above the legend."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=columns)
    rows = -(-len(axes.get_legend_handles_labels()[0]) // columns)
    axes.set_title(title, pad=26.0 + 30.0 * rows)


def bars_chart(die: FinishedDie) -> Sheet:
    """Target and achieved probabilities of a die."""
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
    """95 % intervals (k, 2) of the prints of a die around probabilities (k,), if known."""
    tolerances = result.tolerances
    return None if tolerances is None else intervals_of_prints(probabilities, tolerances.deviations)


def before_after_chart(die: FinishedDie) -> Sheet:
    """Probabilities before and after a surface was made into a die, in front of the target; the
    last bars are the rests that count for no outcome."""
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
    """Probabilities without momentum, by the momentum model and, if there are any, in simulated
    throws with exact intervals, in front of the target."""
    result, thrown = die.result, die.result.thrown
    assert thrown is not None
    momentum = thrown.momentum
    bars = [
        Bars("without momentum", FAINT, result.probabilities, values=()),
        Bars("momentum model", MODEL, momentum, _prints_of(result, momentum), values=()),
    ]
    simulated = thrown.simulated
    if simulated is None:
        each = [f"{b.name} {total_variation(b.probabilities, result.target):.4f}" for b in bars]
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
    """Tested probabilities beside the frequencies of throws, with exact intervals and, for at most
    16 outcomes, counts.

    labels: k outcomes. Raises InputError: the verdict has not one probability for each.
    """
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
