"""Charts of the course of a design, of rounds of throws, and of attempts at a concave die."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator
from numpy.polynomial import Polynomial

from dicedesign.fabricate.die import FinishedDie
from dicedesign.palette import ACCENT, BASINS, DARK, DISTINCT, FAINT
from dicedesign.report.bar_charts import LIMITS, put_legend_above
from dicedesign.report.sheet import NOTE, Sheet, with_style
from dicedesign.results.parts import Status
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats

MAX_MARKERS = 60
"""Most points of a curve that are marked."""

MAX_TICKS = 9
"""Most ticks of a logarithmic axis."""

ZERO_RATIO = 1e-18
"""Values below this times the largest are drawn as zero in the course of a design."""

WIDE_RATIO = 50.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""

LEGEND_ROWS = 16
"""Most entries of a column of a legend beside a chart."""

ZERO_ERROR = 1e-9
"""Errors of attempts up to this are drawn as zero."""

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Digits as superscripts."""


@with_style
def course_chart(die: FinishedDie) -> Sheet:
    """Error and energy of a design against its run time, or against its steps without a clock.

    If there are several stages, each has its own energy: curves are broken between stages, which
    are colored stretches. If a design continued by preference after it had met its target, the
    energy is drawn from there on; before, it repeats the error. Zeros are drawn at the lower end of
    a logarithmic axis, which is then marked 0. Steps without an error have no point.

    die: its history has at least one step; a stage may occur again.
    """
    history: Sequence[Step] = die.result.history
    clock = "accepted steps" if history[0].seconds is None else "run time"

    def time(step: Step) -> float:
        return float(step.step) if step.seconds is None else step.seconds

    preferred = [step for step in history if "preferences" in step.terms]
    runs = [(name, list(run)) for name, run in groupby(preferred or history, lambda s: s.stage)]
    stages = dict.fromkeys(name for name, _ in runs if name is not None)
    energy = "energy of each stage" if stages else "energy"
    errors = [(time(s), s.max_abs_error) for s in history if s.max_abs_error is not None]
    energies = [[(time(s), s.energy) for s in run] for _, run in runs]
    sheet = Sheet(1415.0, 600.0 if stages else 560.0)
    for place, name, curves, level in (
        (115.0, "error", [errors], [die.tolerance]),
        (830.0, "energy of preferences" if preferred else energy, energies, []),
    ):
        axes = sheet.axes(place, 65.0, place + 555.0, 485.0)
        axes.set(
            title=f"{name} against {clock}",
            xlabel="run time (s)" if clock == "run time" else clock,
            ylabel="error, max |p − q|" if level else name,
            xlim=(0.0, 1.03 * max(1e-3, *map(time, history))),
        )
        axes.grid()
        values = np.array([y for curve in curves for _, y in curve] + level)
        zero, low = values.max() * ZERO_RATIO, 0.0
        is_wide = values.max() > WIDE_RATIO * max(values.min(), zero)
        # Energies of several stages cannot be compared.
        if level or is_wide or (stages and values.max() > 0.0):
            low = _set_log_heights(axes, values, zero)
        for curve in curves:
            x, y = np.reshape(curve, (-1, 2)).T
            marker = "o" if len(values) <= MAX_MARKERS or len(curve) == 1 else ""
            axes.plot(x, np.where(y > zero, y, low), color=ACCENT, marker=marker, clip_on=False)
        if level:
            _draw_tolerance(axes, die.tolerance)
        if not any(curves):
            axes.text(0.5, 0.5, "not known", transform=axes.transAxes, ha="center", color=FAINT)
        begin, colors = 0.0, dict(zip(stages, BASINS, strict=False))
        for stage, run in runs if stages else ():
            end, color = time(run[-1]), colors[stage]
            axes.axvspan(begin, end, alpha=0.35, zorder=0.4, color=color, lw=0.0, label=stage)
            begin = end
    spans = {span.get_label(): span for span in axes.patches}
    sheet.figure.legend(handles=list(spans.values()), loc="lower center", ncols=8, borderpad=0.8)
    return sheet


def _set_log_heights(axes: Axes, values: Floats, zero: float) -> float:
    """Make the vertical axis logarithmic around values (n,), at least one of them above 0, with
    ticks at powers of ten.

    Returns its lower end, where values up to `zero` are drawn; it is marked 0 if there are any.
    """
    positive = values[values > zero]
    low, high = float(positive.min(initial=values.max())) / 5.0, 3.0 * float(values.max())
    powers = np.arange(np.ceil(np.log10(low)), np.log10(high)).astype(int)
    powers = powers[:: -(-len(powers) // MAX_TICKS)]
    ticks = {10.0**k: f"10{str(k).translate(RAISED)}" for k in powers.tolist()}
    if len(positive) < len(values):
        ticks = {low: "0", **ticks}
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    axes.set_yticks(list(ticks), list(ticks.values()))
    axes.set_yticks([], minor=True)
    return low


def _draw_tolerance(axes: Axes, tolerance: float) -> None:
    axes.axhline(tolerance, color=FAINT, linestyle="--", linewidth=2.0)
    axes.annotate(
        f"tolerance {tolerance:.2g}",
        (0.99, tolerance),
        (0.0, 6.0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        size=NOTE,
        color=FAINT,
        ha="right",
    )


@with_style
def rounds_chart(die: FinishedDie) -> Sheet:
    """Total variation from the target, of the die of each round, against the number of throws.

    For each round: the total variation in its own throws, the one of a perfect die in as many
    throws, and those expected from the throws of all rounds, for the mean of the tables and for
    nine in ten of them. The verdict on the finished die, if there is one, is last, with its
    95 % interval.

    die: designed for a table, in at least one round.
    """
    assert die.result.thrown is not None
    rounds, simulated = die.result.thrown.rounds, die.result.thrown.simulated
    at = np.cumsum([entry.drops for entry in rounds], dtype=np.float64)
    expected = np.array([entry.expected for entry in rounds])
    drops, floors = at, [entry.noise_floor for entry in rounds]
    sheet = Sheet(1275.0, 605.0, grows=True)
    axes = sheet.axes(145.0, 100.0, 1235.0, 510.0)
    if simulated is not None:
        floors.append(simulated.noise_floor)
        drops = np.append(drops, drops[-1] + simulated.drops)
        low, high = simulated.interval
        axes.errorbar(drops[-1], (low + high) / 2.0, (high - low) / 2.0, fmt="none", **LIMITS)
        name = "finished die, with its 95 % interval"
        axes.plot(drops[-1:], [simulated.total_variation], "D", color=DARK, label=name, ms=13.0)
    axes.plot(drops, floors, "o--", color=FAINT, lw=2.5, ms=8.0, label="a perfect die")
    axes.plot(at, [entry.deviation for entry in rounds], "o", color=FAINT, label="its throws")
    axes.plot(at, expected, "o-", color=ACCENT, ms=14.0, label="expected")
    is_kept = [entry.is_kept for entry in rounds]
    axes.plot(at[is_kept], expected[is_kept], "o", color=DARK, ms=6.0, label="kept")
    axes.set(xlim=(0.0, 1.05 * float(drops[-1])), ylim=(0.0, 1.05 * axes.get_ylim()[1]))
    axes.set(xlabel="simulated throws so far", ylabel="total variation to the target")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.grid()
    put_legend_above(axes, "deviation from the target, round by round", 3)
    return sheet


@with_style
def hands_chart(die: FinishedDie) -> Sheet:
    """Probabilities of the outcomes on each table of a mixture, against the energy of its throws,
    with a parabola in the logarithm of the energy and the target of each outcome.

    die: thrown onto a mixture.
    """
    assert die.thrown is not None
    assert die.result.thrown is not None
    by_table, target = die.result.thrown.by_table, die.result.target
    assert by_table is not None
    energies = np.array([table.energy for table in die.thrown.die.tables])
    even = np.geomspace(energies.min(), energies.max(), 50)
    sheet = Sheet(1275.0, 640.0, grows=True)
    axes = sheet.axes(120.0, 60.0, 1120.0, 545.0)
    outcomes = zip(die.result.labels, np.array(by_table.probabilities).T, target, strict=True)
    for place, (label, probabilities, wanted) in enumerate(outcomes):
        color = DISTINCT[place % len(DISTINCT)]
        axes.plot(energies, 100.0 * probabilities, "o", color=color, ms=6.0, alpha=0.6, label=label)
        curve = Polynomial.fit(np.log(energies), 100.0 * probabilities, 2)
        axes.plot(even, curve(np.log(even)), color=color)
        axes.axhline(100.0 * wanted, color=color, lw=1.5, ls="--")
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xticks([], minor=True)
    axes.set_ylim(bottom=0.0)
    columns = -(-len(target) // LEGEND_ROWS)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), ncols=columns)
    axes.set(xlabel="energy of the throw (weights × sizes of the die)", ylabel="probability (%)")
    axes.set_title(
        f"total variation on nine in ten hands {by_table.often:.4f}, worst {by_table.worst:.4f}"
    )
    axes.grid()
    return sheet


@with_style
def trade_off_chart(die: FinishedDie) -> Sheet:
    """Error against displacement of each draft of a concave die, and of the original surface.

    Drafts are marked by their worst flaw. die: made by a search.
    """
    search = die.result.search
    assert search is not None
    trade_off, chosen = search.trade_off, search.attempt
    drafts, level = trade_off.drafts, trade_off.tolerance
    sheet = Sheet(1215.0, 740.0, grows=True)
    axes = sheet.axes(130.0, 60.0, 1175.0, 645.0)
    axes.set(
        xlabel="mean displacement (% of the diagonal)",
        ylabel="error, max |p − q| or elsewhere",
        title="smaller is better in both",
    )
    axes.grid()
    errors = np.array([level, die.result.error_before, *(draft.error for draft in drafts)])
    low = _set_log_heights(axes, errors, ZERO_ERROR)
    heights = np.where(errors > ZERO_ERROR, errors, low).tolist()
    places = {
        d.attempt: (100.0 * d.displacement, y) for d, y in zip(drafts, heights[2:], strict=True)
    }
    right = 1.08 * max((x for x, _ in places.values()), default=0.0) or 1.0
    axes.set_xlim(-0.03 * right, right)
    _draw_tolerance(axes, level)
    hollow: dict[str, Any] = {"color": DARK, "mfc": "white", "mew": 2.0}

    def draw(label: str, points: Sequence[tuple[float, float]], **style: Any) -> None:
        x, y = np.reshape(points, (-1, 2)).T
        axes.plot(x, y, linestyle="", clip_on=False, label=label, **style)

    this = [places[attempt] for attempt in places if attempt == chosen]
    draw("this die", this, marker="o", ms=28.0, **hollow)
    draw("the original surface", [(0.0, heights[1])], marker="*", ms=20.0, **hollow)
    worst = {draft.attempt: next(trade_off.flaws(draft), None) for draft in drafts}
    for status, name, color, marker, size in (
        (None, "as wanted", ACCENT, "o", 13.0),
        (Status.OFF_TARGET, "probabilities off", FAINT, "x", 11.0),
        (Status.SELF_INTERSECTING, "intersects itself", DISTINCT[4], "^", 14.0),
        (Status.TOO_NEAR, f"outcomes nearer than {trade_off.apart_deg:g}°", DISTINCT[1], "s", 11.0),
        (Status.TIPPY, f"tips over below {trade_off.margin_deg:g}°", DISTINCT[2], "D", 11.0),
        (Status.FRAGILE, "prints off", DISTINCT[3], "v", 14.0),
    ):
        group = [places[attempt] for attempt in worst if worst[attempt] is status]
        style = {"color": color, "marker": marker, "ms": size, "mew": 3.0 if marker == "x" else 1.0}
        if group:
            draw(f"{name} ({len(group)})", group, **style)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)
    # The die itself is numbered first; a number that would cover an earlier one is left out.
    room, written = np.array([37.0, 21.0]), np.zeros((0, 2))
    for number, point in sorted(places.items(), key=lambda item: item[0] != chosen):
        place = axes.transData.transform(point)
        if not (np.abs(place - written) < room).all(axis=1).any():
            written = np.vstack([written, place])
            axes.annotate(str(number), point, (9, 6), textcoords="offset points", size=NOTE)
    return sheet
