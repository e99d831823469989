"""Charts of the course of a design, of rounds of throws, and of attempts at a concave die."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.polynomial import Polynomial

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.palette import ACCENT, DARK, FAINT, PALE, outcome_colors
from dicedesign.report.bar_charts import LIMITS, chart_height, put_legend_above
from dicedesign.report.paper import COLUMN_WIDTH, GAP, POINTS
from dicedesign.report.sheet import BODY, NOTE, Sheet, fold, key_height, with_style
from dicedesign.results.parts import Status
from dicedesign.results.result import Result, Step
from dicedesign.runtime.arrays import Floats

MAX_MARKERS = 60
"""Most points of a curve that are marked."""

MAX_TICKS = 7
"""Most ticks of a logarithmic axis."""

ZERO_RATIO = 1e-18
"""Values below this times the largest are drawn as zero in the course of a design."""

WIDE_RATIO = 50.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""

ZERO_ERROR = 1e-9
"""Errors of attempts up to this are drawn as zero."""

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Digits as superscripts."""

STAGES = (("#ffffff", ""), ("#e6e9ec", ""), ("#ffffff", "////"))
"""Color and hatching of the stages of a design."""

MARKERS = "osD^vPX<>*"
"""Markers of outcomes, in their order; they repeat after ten."""


@with_style
def history(
    result: Result, tolerance: float | None = None, *, width: float = COLUMN_WIDTH
) -> Sheet:
    """Error and energy of a design against its run time, or against its steps without a clock.

    If there are several stages, each has its own energy: curves are broken between stages, which
    are shaded stretches. If a design continued by preference after it had met its target, the
    energy is drawn from there on; before, it repeats the error. Zeros are drawn at the lower end of
    a logarithmic axis, which is then marked 0. Steps without an error have no point.

    Parameters
    ----------
    result: its history has at least one step; a stage may occur again.
    tolerance: largest allowed error, drawn as a line, or None.
    width: in inches.
    """
    steps: Sequence[Step] = result.history
    clock = "accepted steps" if steps[0].seconds is None else "run time (s)"

    def time(step: Step) -> float:
        return float(step.step) if step.seconds is None else step.seconds

    preferred = [step for step in steps if "preferences" in step.terms]
    runs = [(name, list(run)) for name, run in groupby(preferred or steps, lambda s: s.stage)]
    stages = dict.fromkeys(name for name, _ in runs if name is not None)
    energy = "energy of each stage" if stages else "energy"
    errors = [(time(s), s.max_abs_error) for s in steps if s.max_abs_error is not None]
    energies = [[(time(s), s.energy) for s in run] for _, run in runs]
    shades = dict(zip(stages, cycle(STAGES), strict=False))
    keys = [Patch(fc=fill, hatch=hatch, ec=FAINT, label=s) for s, (fill, hatch) in shades.items()]
    # Beside each other on a wide sheet, else below.
    rows, columns = (1, 2) if width >= 2.0 * COLUMN_WIDTH else (2, 1)
    high = rows * (chart_height(width / columns) - 20.0)
    sheet = Sheet(POINTS * width, high + (GAP + key_height(keys, POINTS * width) if keys else 0.0))
    levels = [] if tolerance is None else [tolerance]
    for axes, name, curves, level in zip(
        sheet.charts(rows, columns, bottom=high),
        ("error, max |p − q|", "energy of preferences" if preferred else energy),
        ([errors], energies),
        (levels, []),
        strict=True,
    ):
        axes.set(ylabel=name, xlim=(0.0, 1.03 * max(1e-3, *map(time, steps))))
        axes.grid()
        values = np.array([y for curve in curves for _, y in curve] + level)
        zero, low = values.max(initial=0.0) * ZERO_RATIO, 0.0
        is_wide = len(values) and values.max() > WIDE_RATIO * max(values.min(), zero)
        # Energies of several stages cannot be compared.
        if (curves[0] is errors or is_wide or stages) and values.any():
            low = _set_log_heights(axes, values, zero)
        for curve in filter(None, curves):
            x, y = np.reshape(curve, (-1, 2)).T
            marker = "o" if len(values) <= MAX_MARKERS or len(curve) == 1 else ""
            axes.plot(x, np.where(y > zero, y, low), color=ACCENT, marker=marker, clip_on=False)
        if level:
            _draw_tolerance(axes, *level)
        if not any(curves):
            axes.text(0.5, 0.5, "not known", transform=axes.transAxes, ha="center", color=FAINT)
        begin = 0.0
        for stage, run in runs if stages else ():
            end, (fill, hatch) = time(run[-1]), shades[stage]
            axes.axvspan(begin, end, zorder=0.4, fc=fill, hatch=hatch, ec=PALE, lw=0.0, label=stage)
            begin = end
        axes.set_xlabel(clock)
    if keys:
        sheet.add_key(keys, high + 2.0)
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
    axes.axhline(tolerance, color=FAINT, linestyle="--", linewidth=0.8)
    axes.annotate(
        f"tolerance {tolerance:.2g}",
        (0.99, tolerance),
        (0.0, 2.0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        size=NOTE,
        color=DARK,
        ha="right",
    )


@with_style
def rounds(result: Result, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Total variation from the target, of the die of each round, against the number of throws.

    For each round: the total variation in its own throws, the one of a perfect die in as many
    throws, and those expected from the throws of all rounds, for the mean of the tables and for
    nine in ten of them. The verdict on the finished die, if there is one, is last, with its
    95 % interval.

    result: of a die designed for a table, in at least one round; width: in inches.

    Raises InputError: there were no rounds.
    """
    if result.thrown is None or not result.thrown.rounds:
        raise InputError(
            f"{result.name}: expected a die with rounds of simulated throws, got one without; "
            "design it with throws: simulated"
        )
    entries, simulated = result.thrown.rounds, result.thrown.simulated
    at = np.cumsum([entry.drops for entry in entries], dtype=np.float64)
    expected = np.array([entry.expected for entry in entries])
    drops, floors = at, [entry.noise_floor for entry in entries]
    sheet = Sheet(POINTS * width, chart_height(width))
    (axes,) = sheet.charts()
    if simulated is not None:
        floors.append(simulated.noise_floor)
        drops = np.append(drops, drops[-1] + simulated.drops)
        low, high = simulated.interval
        axes.errorbar(drops[-1], (low + high) / 2.0, (high - low) / 2.0, fmt="none", **LIMITS)
        name = "finished die, with its 95 % interval"
        axes.plot(drops[-1:], [simulated.total_variation], "D", color=DARK, label=name, ms=5.0)
    axes.plot(drops, floors, "x--", color=FAINT, lw=0.8, label="a perfect die")
    axes.plot(at, [entry.deviation for entry in entries], "s", color=FAINT, label="its throws")
    axes.plot(at, expected, "o-", color=ACCENT, ms=5.5, label="expected")
    is_kept = [entry.is_kept for entry in entries]
    axes.plot(at[is_kept], expected[is_kept], "o", color=DARK, ms=2.5, label="kept")
    axes.set(xlim=(0.0, 1.05 * float(drops[-1])), ylim=(0.0, 1.05 * axes.get_ylim()[1]))
    axes.set(xlabel="simulated throws so far", ylabel="total variation to the target")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.grid()
    put_legend_above(axes, "deviation from the target, round by round")
    return sheet


@with_style
def hands(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Probabilities of the outcomes on each table of a mixture, against the energy of its throws,
    with a parabola in the logarithm of the energy and the target of each outcome.

    die: thrown onto a mixture; width: in inches.
    """
    assert die.thrown is not None
    assert die.result.thrown is not None
    by_table, target = die.result.thrown.by_table, die.result.target
    assert by_table is not None
    energies = np.array([table.energy for table in die.thrown.die.tables])
    even = np.geomspace(energies.min(), energies.max(), 50)
    sheet = Sheet(POINTS * width, 1.4 * chart_height(width))
    (axes,) = sheet.charts()
    outline = [Stroke(linewidth=1.8, foreground=DARK), Normal()]
    outcomes = zip(die.result.labels, np.array(by_table.probabilities).T, target, strict=True)
    colors = outcome_colors(len(target))
    for (label, values, wanted), color, marker in zip(
        outcomes, colors, cycle(MARKERS), strict=False
    ):
        percent = 100.0 * values
        curve = Polynomial.fit(np.log(energies), percent, 2)
        axes.axhline(100.0 * wanted, color=FAINT, lw=0.7, ls="--")
        axes.plot(even, curve(np.log(even)), color=color, lw=1.0, path_effects=outline)
        axes.plot(energies, percent, marker, color=color, mec=DARK, mew=0.5, label=label)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xticks([], minor=True)
    axes.set_ylim(bottom=0.0)
    x_label = "energy of the throw (weights × sizes of the die)"
    axes.set(xlabel=fold(x_label, 0.8 * sheet.width, BODY), ylabel="probability (%)")
    axes.grid()
    put_legend_above(
        axes,
        f"total variation on nine in ten hands {by_table.often:.4f}, worst {by_table.worst:.4f}",
    )
    return sheet


@with_style
def trade_off(result: Result, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Error against displacement of each draft of a concave die, and of the original surface.

    Drafts are marked by their worst flaw. Numbers that would cover others are left out.

    result: of a die made by a search; width: in inches. Raises InputError: there was no search.
    """
    search = result.search
    if search is None:
        raise InputError(
            f"{result.name}: expected a concave die made by a search, got another; take a result "
            "of method: concave"
        )
    draft_search, chosen = search.trade_off, search.attempt
    drafts, level = draft_search.drafts, draft_search.tolerance
    kinds: list[tuple[Status | None, str, str, str]] = [
        (None, "as wanted", ACCENT, "o"),
        (Status.OFF_TARGET, "probabilities off", DARK, "x"),
        (Status.SELF_INTERSECTING, "intersects itself", DARK, "^"),
        (Status.TOO_NEAR, f"outcomes nearer than {draft_search.apart_deg:g}°", FAINT, "s"),
        (Status.TIPPY, f"tips over below {draft_search.margin_deg:g}°", FAINT, "D"),
        (Status.FRAGILE, "prints off", FAINT, "v"),
    ]
    sheet = Sheet(POINTS * width, 1.4 * chart_height(width))
    (axes,) = sheet.charts()
    axes.set(
        xlabel="mean displacement (% of the diagonal)",
        ylabel="error, max |p − q| or elsewhere",
    )
    axes.grid()
    errors = np.array([level, result.error_before, *(draft.error for draft in drafts)])
    low = _set_log_heights(axes, errors, ZERO_ERROR)
    heights = np.where(errors > ZERO_ERROR, errors, low).tolist()
    places = {
        d.attempt: (100.0 * d.displacement, y) for d, y in zip(drafts, heights[2:], strict=True)
    }
    right = 1.08 * max((x for x, _ in places.values()), default=0.0) or 1.0
    axes.set_xlim(-0.03 * right, right)
    _draw_tolerance(axes, level)
    hollow: dict[str, Any] = {"color": DARK, "mfc": "white", "mew": 0.8}

    def draw(label: str, points: Sequence[tuple[float, float]], **style: Any) -> None:
        if points:
            axes.plot(*np.transpose(points), linestyle="", clip_on=False, label=label, **style)

    this = [places[attempt] for attempt in places if attempt == chosen]
    draw("this die", this, marker="o", ms=9.5, **hollow)
    draw("the original surface", [(0.0, heights[1])], marker="*", ms=7.0, **hollow)
    worst = {draft.attempt: next(draft_search.flaws(draft), None) for draft in drafts}
    for status, name, color, marker in kinds:
        group = [places[attempt] for attempt in worst if worst[attempt] is status]
        draw(f"{name} ({len(group)})", group, color=color, marker=marker, ms=4.5)
    put_legend_above(axes, "smaller is better in both")
    sheet.draw_without_rendering()
    # The die itself is numbered first.
    room, written = np.array([13.0, 8.0]) * sheet.dpi / POINTS, np.zeros((0, 2))
    for number, point in sorted(places.items(), key=lambda item: item[0] != chosen):
        place = axes.transData.transform(point)
        if not (np.abs(place - written) < room).all(axis=1).any():
            written = np.vstack([written, place])
            axes.annotate(str(number), point, (3, 2), textcoords="offset points", size=NOTE)
    return sheet
