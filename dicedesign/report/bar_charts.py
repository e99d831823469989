"""Bar charts of the probabilities of outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend_handler import HandlerTuple
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.palette import BLANK, DARK, PALE, outcome_colors
from dicedesign.report.paper import COLUMN_WIDTH, POINTS
from dicedesign.report.sheet import (
    BODY,
    LEGEND_LINE,
    LINE,
    NOTE,
    Sheet,
    fold,
    legend_columns,
    text_width,
    with_style,
)
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.distances import total_variation
from dicedesign.throws.goodness_of_fit import RollVerdict

COMPARED = (("#ffffff", "//////"), ("#b4bcc5", ""))
"""Color and hatching of the series before the last, which has the colors of the outcomes."""

AXIS_ROOM = 45.0
"""Width of the vertical axis with its numbers and its name, in points."""

DEVIATIONS_95 = 1.96
"""Half-width of the 95 % interval of a normal distribution, in standard deviations."""

LIMITS: dict[str, Any] = {"ecolor": DARK, "elinewidth": 0.8, "capsize": 2.0, "capthick": 0.8}


@dataclass(frozen=True)
class Bars:
    """Series of bars.

    Attributes
    ----------
    name: name in the legend.
    probabilities: (k,) in [0, 1].
    intervals: (k, 2) limits of error bars, or None.
    interval_name: name of the error bars in the legend.
    values: k texts above the bars, or an empty sequence; None for the probabilities in percent.
    """

    name: str
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
    series: Sequence[Bars],
    *,
    title: str,
    x_label: str,
    target: ArrayLike | None = None,
    colors: Sequence[str] | None = None,
    width: float = COLUMN_WIDTH,
    sheet: Sheet | None = None,
) -> Sheet:
    """Group of bars for each outcome, in front of a wide bar of its target if there is one.

    The last series has the colors of the outcomes, those before it are white or gray. Values are
    written above the bars where there is room.

    Parameters
    ----------
    labels: k outcomes, at least one.
    series: one to three.
    target: (k,) in [0, 1], or None.
    colors: k colors, or None for those of k outcomes.
    width: in inches.
    sheet: a sheet to draw on, at its upper end, or None for a new one.

    Raises
    ------
    InputError: there is no outcome, or a series has not one probability for each.
    """
    counts = [len(np.asarray(bars.probabilities)) for bars in series]
    counts += [] if target is None else [len(np.asarray(target))]
    if not labels or set(counts) != {len(labels)}:
        raise InputError(
            "bars: expected at least one outcome, with one probability of each kind each, got "
            f"{len(labels)} labels and {', '.join(map(str, counts))} probabilities"
        )
    count, bar_width = len(labels), 0.8 / len(series)
    places, colors = np.arange(float(count)), outcome_colors(count) if colors is None else colors
    height = chart_height(width)
    sheet = Sheet(POINTS * width, height) if sheet is None else sheet
    (axes,) = sheet.charts(bottom=height)
    entries: list[tuple[Any, str]] = []
    if target is not None:
        wanted = 100.0 * np.asarray(target, dtype=np.float64)
        boxes = axes.bar(places, wanted, 0.94, color=PALE, alpha=0.55, label="target")
        entries.append((boxes, "target"))
        axes.hlines(wanted, places - 0.47, places + 0.47, color=DARK, linewidth=1.0, zorder=3.0)
    drawn = []
    for number, bars in enumerate(series):
        percent = 100.0 * np.asarray(bars.probabilities, dtype=np.float64)
        middles = places + (number - (len(series) - 1) / 2.0) * bar_width
        is_last = number == len(series) - 1
        color, hatch = (colors, "") if is_last else COMPARED[number % len(COMPARED)]
        boxes = axes.bar(
            middles, percent, bar_width, color=color, hatch=hatch, edgecolor=DARK, label=bars.name
        )
        # The mark of the last series in the legend has three of its colors.
        few = [colors[k] for k in sorted({0, count // 2, count - 1})]
        mark = tuple(Patch(fc=one, ec=DARK) for one in few) if is_last else boxes
        entries.append((mark, bars.name))
        drawn.append((boxes, [f"{p:.2f}" for p in percent] if bars.values is None else bars.values))
        if bars.intervals is not None:
            ends = np.abs(100.0 * np.asarray(bars.intervals, dtype=np.float64).T - percent)
            boxes.errorbar = axes.errorbar(middles, percent, ends, fmt="none", **LIMITS)
            entries.append((boxes.errorbar, bars.interval_name))
    highest = max(axes.dataLim.y1, 1e-7)
    axes.set(xlim=(-0.6, count - 0.4), ylim=(0.0, highest), ylabel="probability (%)")
    axes.set_xlabel(fold(x_label, sheet.width - AXIS_ROOM, BODY))
    spacing = (sheet.width - AXIS_ROOM) / (count + 0.2)
    # Long labels are turned, and some are left out if even these do not fit.
    is_wide = max(text_width(text, NOTE) for text in labels) + 2.0 > spacing
    shown = slice(None, None, max(1, -int(-LINE * NOTE // spacing)) if is_wide else 1)
    axes.set_xticks(places[shown], list(labels)[shown], size=NOTE, rotation=90.0 * is_wide)
    put_legend_above(axes, title, entries)
    sheet.draw_without_rendering()
    box = axes.get_window_extent()
    tall, spacing = (side * POINTS / sheet.dpi for side in (box.height, box.width / (count + 0.2)))
    room = 4.0
    for boxes, values in drawn:
        widest = max((text_width(text, NOTE) for text in values), default=0.0)
        is_turned = widest + 2.0 > bar_width * spacing
        if values and (not is_turned or bar_width * spacing >= NOTE):
            room = max(room, 6.0 + (widest if is_turned else NOTE))
            axes.bar_label(boxes, values, padding=2.0, size=NOTE, rotation=90.0 * is_turned)
    # Leave room for the value above the highest bar.
    axes.set_ylim(0.0, highest * tall / (tall - room))
    return sheet


def chart_height(width: float) -> float:
    """Height in points of a chart that is `width` inches wide."""
    return 140.0 + 14.0 * width


def put_legend_above(
    axes: Axes, title: str, entries: Sequence[tuple[Any, str]] | None = None
) -> None:
    """Add a legend above axes, and a title above the legend.

    entries: marks and names, or None for those of the axes.
    """
    entries = (
        list(zip(*axes.get_legend_handles_labels(), strict=True)) if entries is None else entries
    )
    handles, names = zip(*entries, strict=True)
    figure = axes.figure
    room = POINTS * float(figure.get_figwidth()) - AXIS_ROOM  # type: ignore[union-attr]
    columns = legend_columns([Patch(label=name) for name in names], room)
    axes.legend(
        handles,
        names,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.02),
        ncols=columns,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)},
    )
    rows = -(-len(names) // columns)
    axes.set_title(fold(title, room, BODY), loc="left", pad=4.0 + LEGEND_LINE * rows)


def probabilities(result: Result, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Achieved probabilities of the outcomes of a die in front of their target.

    width: in inches.
    """
    achieved = result.probabilities
    worst = float(np.abs(np.subtract(result.target, achieved)).max(initial=0.0))
    return outcome_chart(
        result.labels,
        [Bars("achieved", achieved, _intervals_of_prints(result, achieved))],
        title=f"target and achieved probabilities, max |p − q| = {worst:.2g}",
        x_label="outcome (label on the resting facet)",
        target=result.target,
        width=width,
    )


def _intervals_of_prints(result: Result, values: ArrayLike) -> Floats | None:
    """95 % intervals (k, 2) of the prints of a die around probabilities (k,), if known."""
    tolerances = result.tolerances
    return None if tolerances is None else intervals_of_prints(values, tolerances.deviations)


def reshaped_probabilities(result: Result, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Probabilities before and after a surface was made into a concave die, in front of the target;
    the last bars are the rests that count for no outcome.

    width: in inches. Raises InputError: the die is convex.
    """
    concave = result.concave
    if concave is None:
        raise InputError(
            f"{result.name}: expected a concave die, got a convex one; take a result of "
            "method: concave"
        )
    worst_before, worst = (
        np.abs(np.subtract(values, result.target)).max(initial=0.0)
        for values in (concave.probabilities_before, result.probabilities)
    )
    return outcome_chart(
        [*result.labels, "elsewhere"],
        [
            Bars("before", [*concave.probabilities_before, concave.elsewhere_before]),
            Bars("after", [*result.probabilities, result.elsewhere]),
        ],
        title=f"max |p − q| = {worst_before:.2g} before, {worst:.2g} after",
        x_label="outcome that the body comes to rest on",
        target=[*result.target, 0.0],
        colors=[*outcome_colors(len(result.labels)), BLANK],
        width=width,
    )


def table_probabilities(result: Result, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Probabilities without momentum, by the momentum model and, if there are any, in simulated
    throws with exact intervals, in front of the target.

    width: in inches. Raises InputError: the die was not designed for a table.
    """
    thrown = result.thrown
    if thrown is None:
        raise InputError(
            f"{result.name}: expected a die designed for a table, got one without; design it with "
            "table=, or a recipe's method.exact.table"
        )
    momentum = thrown.momentum
    bars = [
        Bars("without momentum", result.probabilities, values=()),
        Bars("momentum model", momentum, _intervals_of_prints(result, momentum), values=()),
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
        bars.append(Bars("simulated throws", frequencies, limits, "exact 95 % interval", ()))
    return outcome_chart(
        result.labels,
        bars,
        title=title,
        x_label="outcome (label on the resting facet)",
        target=result.target,
        width=width,
    )


def roll_frequencies(
    labels: Sequence[str], verdict: RollVerdict, *, width: float = COLUMN_WIDTH
) -> Sheet:
    """Frequencies of throws with their counts and exact intervals, beside the tested
    probabilities.

    labels: k outcomes; width: in inches.

    Raises InputError: the verdict has not one probability for each.
    """
    variation = verdict.variation
    thrown = Bars(
        "thrown",
        verdict.frequencies,
        verdict.intervals,
        f"exact {100 * verdict.confidence:g} % interval",
        [str(count) for count in verdict.counts],
    )
    return outcome_chart(
        labels,
        [Bars("probabilities tested", verdict.probabilities, values=()), thrown],
        title=(
            f"{verdict.throws} throws: p = {verdict.p_value:.2g}, total variation "
            f"{variation.value:.3f} (a perfect die: {variation.noise_floor:.3f})"
        ),
        x_label="outcome (number above a bar: its count)",
        width=width,
    )
