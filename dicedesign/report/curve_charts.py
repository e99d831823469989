"""Curves along the course of a design, rounds of throws, and points of attempts and trials."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.report.palette import ACCENT, BASINS, DARK, DISTINCT, FAINT, PALE, repeated
from dicedesign.report.sheet import BODY, NOTE, Sheet, set_log_heights, styled
from dicedesign.results.parts import Draft, Status, ThrownOdds, TradeOff
from dicedesign.results.result import Step

MOST_MARKERS: Final = 60

MOST_DECADES: Final = 18
"""Values this many powers of ten below the largest count as zero."""

WIDE_RATIO: Final = 50.0
"""Of values to be drawn on a logarithmic axis, the largest to the smallest."""

PREFERENCES: Final = "preferences"
"""Term of the steps that are taken by preference."""

LEVEL: Final[dict[str, Any]] = {"color": FAINT, "linestyle": "--", "linewidth": 2.0}


def convergence_chart(die: FinishedDie) -> Sheet:
    """Error and energy of a design, see `convergence_of`."""
    return convergence_of(die.result.history, die.tolerance)


@styled
def convergence_of(history: Sequence[Step], tolerance: float) -> Sheet:
    """Error and energy of a design against its run time, or its steps without a clock.

    Of a design that went on by preference once its target was met, the energy is drawn from there
    on: before, it is the error once more.

    Parameters
    ----------
    history: accepted steps, at least one; those that do not know their error have no point.
    tolerance: error at which the design is done, above 0.

    Raises
    ------
    InputError: the history is empty.
    """
    preferred = [step for step in history if PREFERENCES in step.terms]
    name = "energy of preferences" if preferred else "energy"
    sheet, (left, right) = _course_sheet(history)
    _draw_course(left, history, [_errors(history)], "error", log=True, level=[tolerance])
    left.axhline(tolerance, **LEVEL)
    left.annotate(
        f"tolerance {tolerance:.2g}",
        (0.0, tolerance),
        (8.0, -4.0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        size=NOTE,
        color=FAINT,
        va="top",
    )
    energies = [(_time(step), step.energy) for step in preferred or history]
    _draw_course(right, history, [energies], name, log=False)
    left.set_ylabel("error, max |p − q|")
    return sheet


def energy_chart(die: FinishedDie) -> Sheet:
    """Error and energy of a design of several stages, see `energy_of`."""
    return energy_of(die.result.history)


@styled
def energy_of(history: Sequence[Step]) -> Sheet:
    """Error and energy against run time, or steps without a clock, both logarithmic, with a
    coloured stretch per stage.

    Each stage has an energy of its own, so the curve is broken between stages.

    history: steps in the order of time, at least one, each of a stage; a stage may come again.

    Raises InputError: the history is empty.
    """
    sheet, (left, right) = _course_sheet(history)
    runs = [(name or "", list(steps)) for name, steps in groupby(history, lambda s: s.stage)]
    names = list(dict.fromkeys(name for name, _ in runs))
    colors = dict(zip(names, repeated(BASINS, len(names)), strict=True))
    energies = [[(_time(step), step.energy) for step in steps] for _, steps in runs]
    _draw_course(left, history, [_errors(history)], "error", log=True)
    _draw_course(right, history, energies, "energy of each stage", log=True)
    left.set_ylabel("error, max |p − q|")
    ends = [_time(steps[-1]) for _, steps in runs]
    for begin, end, (name, _) in zip([0.0, *ends], ends, runs, strict=False):
        for axes in (left, right):
            axes.axvspan(
                begin, end, color=colors[name], alpha=0.35, linewidth=0.0, zorder=0.4, label=name
            )
    handles = {span.get_label(): span for span in left.patches}
    place = (0.5, 0.0)
    sheet.figure.legend(
        handles=list(handles.values()), loc="upper center", bbox_to_anchor=place, ncols=8
    )
    return sheet


def _course_sheet(history: Sequence[Step]) -> tuple[Sheet, tuple[Axes, Axes]]:
    """Two charts beside each other, from the start to a little beyond the last step."""
    if not history:
        raise InputError("history: expected at least one step, got none")
    sheet = Sheet(1450.0, 580.0, grows=True)
    both = sheet.axes(130.0, 65.0, 685.0, 485.0), sheet.axes(850.0, 65.0, 1410.0, 485.0)
    end = max(_time(step) for step in history)
    for axes in both:
        axes.set_xlim(0.0, 1.03 * max(end, 1e-3))
        axes.set_xlabel("accepted steps" if history[0].seconds is None else "run time (s)")
        axes.grid()
    return sheet, both


def _time(step: Step) -> float:
    """Place of a step along the axis."""
    return float(step.step) if step.seconds is None else step.seconds


def _errors(history: Sequence[Step]) -> list[tuple[float, float]]:
    return [(_time(s), s.max_abs_error) for s in history if s.max_abs_error is not None]


def _draw_course(
    axes: Axes,
    history: Sequence[Step],
    parts: Sequence[Sequence[tuple[float, float]]],
    name: str,
    *,
    log: bool,
    level: Sequence[float] = (),
) -> None:
    """Values along the course of one design.

    Values of zero are drawn at the lower end of a logarithmic axis, which is then marked 0.

    parts: curves, each of n places on the course and values, at least 0; those without points are
    left out; name: of the values; log: whether the axis is logarithmic in any case; otherwise where
    values differ widely; level: a value above 0 that the axis reaches too.
    """
    curves = [(np.array(part)[:, 0], np.array(part)[:, 1]) for part in parts if part]
    values = np.concatenate([level, *(y for _, y in curves)])
    largest = float(values.max(initial=0.0)) or 1.0
    positive = values[values > largest * 10.0**-MOST_DECADES]
    lowest = float(positive.min(initial=largest))
    log = log or bool(len(positive) == len(values) and largest > WIDE_RATIO * lowest)
    low = lowest / 5.0
    if log:
        set_log_heights(axes, low, 3.0 * largest, zero=len(positive) < len(values))
        curves = [(x, np.where(y >= lowest, y, low)) for x, y in curves]
    else:
        room = 0.05 * (largest - float(values.min())) or 0.05 * largest
        axes.set_ylim(float(values.min()) - room, largest + room)
    few = sum(len(x) for x, _ in curves) <= MOST_MARKERS
    for x, y in curves:
        axes.plot(x, y, color=ACCENT, marker="o" if few or len(x) == 1 else "", clip_on=False)
    if not curves:
        axes.text(
            0.5, 0.5, "not known", transform=axes.transAxes, size=BODY, color=FAINT, ha="center"
        )
    against = "accepted steps" if history[0].seconds is None else "run time"
    axes.set(title=f"{name} against {against}", ylabel=name)


def rounds_chart(die: FinishedDie) -> Sheet:
    """Rounds of a design for a table, see `rounds_of`."""
    assert die.result.thrown is not None
    return rounds_of(die.result.thrown)


@styled
def rounds_of(thrown: ThrownOdds) -> Sheet:
    """Total variation from the target of the die of each round, against the throws so far: as its
    own throws show it, beside what a perfect die would show in as many, and as the throws of all
    rounds let one expect it, on the table and on what that may be instead.

    The verdict over the finished die, where there is one, comes last, with its interval of 95 %.

    Raises InputError: there is no round.
    """
    rounds, simulated = thrown.rounds, thrown.simulated
    if not rounds:
        raise InputError("rounds: expected at least one, got none")
    each = [entry.drops + entry.elsewhere_drops for entry in rounds]
    drops = np.cumsum(each, dtype=np.float64)
    expected = np.array([entry.expected for entry in rounds])
    floors = [entry.noise_floor for entry in rounds]
    sheet = Sheet(1275.0, 605.0, grows=True)
    axes = sheet.axes(145.0, 100.0, 1235.0, 510.0)
    if simulated is not None:
        floors.append(simulated.noise_floor)
        drops = np.append(drops, drops[-1] + simulated.drops)
        low, high = simulated.interval
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        line: dict[str, Any] = {"fmt": "none", "ecolor": DARK, "elinewidth": 2.0, "capsize": 6}
        axes.errorbar(drops[-1:], [middle], [half], capthick=2.0, **line)
        name = "finished die, with its 95 % interval"
        axes.plot(drops[-1:], [simulated.total_variation], "D", color=DARK, label=name, ms=13.0)
    at = drops[: len(rounds)]
    axes.plot(drops, floors, "o--", color=FAINT, lw=2.5, ms=8.0, label="a perfect die")
    axes.plot(at, [entry.deviation for entry in rounds], "o", color=FAINT, label="its throws")
    elsewhere = [entry.elsewhere for entry in rounds if entry.elsewhere is not None]
    if elsewhere:
        tables = "expected on nine of ten tables"
        axes.plot(at, elsewhere, "^-", color="#e0ab8c", lw=2.0, label=tables)
    axes.plot(at, expected, "o-", color=ACCENT, ms=14.0, label="expected")
    kept = [entry.is_kept for entry in rounds]
    axes.plot(at[kept], expected[kept], "o", color=DARK, ms=6.0, label="kept")
    axes.set_xlim(0.0, 1.05 * float(drops[-1]))
    axes.set_ylim(0.0, 1.05 * axes.get_ylim()[1])
    axes.set(xlabel="simulated throws so far", ylabel="total variation to the target")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.grid()
    columns, entries = 4, len(axes.get_legend_handles_labels()[0])
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=columns)
    title = "deviation from the target, round by round"
    axes.set_title(title, pad=26.0 + 30.0 * -(-entries // columns))
    return sheet


STYLES: Final[dict[Status | None, dict[str, Any]]] = {
    None: {"color": ACCENT, "marker": "o", "ms": 13.0},
    Status.OFF_TARGET: {"color": FAINT, "marker": "x", "ms": 11.0, "mew": 3.0},
    Status.SELF_INTERSECTING: {"color": DISTINCT[4], "marker": "^", "ms": 14.0},
    Status.TOO_NEAR: {"color": DISTINCT[1], "marker": "s", "ms": 11.0},
    Status.TIPPY: {"color": DISTINCT[2], "marker": "D", "ms": 11.0},
}
"""By what is worst of a draft."""

LEAST_ERROR: Final = 1e-9
"""Errors below are drawn as zero."""


def trade_off_chart(die: FinishedDie) -> Sheet:
    """What the attempts at a concave die led to, see `trade_off_of`."""
    search = die.result.search
    assert search is not None
    return trade_off_of(search.trade_off, search.attempt, die.result.error_before)


@styled
def trade_off_of(trade_off: TradeOff, chosen: int | None, before: float) -> Sheet:
    """A point for each draft: its error against its displacement, both better if smaller, marked by
    what is worst of it, beside the surface as it came.

    chosen: number of the attempt whose draft became the die, or None; before: error of the surface
    as it came.
    """
    drafts, level = trade_off.drafts, trade_off.tolerance
    errors = [level, before, *(draft.error for draft in drafts)]
    positive = [error for error in errors if error > LEAST_ERROR]
    low = min(positive) / 4.0
    sheet, axes = _scatter_sheet("mean displacement (% of the diagonal)")
    set_log_heights(axes, low, 3.0 * max(positive), zero=len(positive) < len(errors))
    right = 1.08 * max((100.0 * draft.displacement for draft in drafts), default=0.0) or 1.0
    axes.set(xlim=(-0.03 * right, right), title="smaller is better in both")
    axes.set_ylabel("error, max |p − q| or elsewhere")
    axes.axhline(level, **LEVEL)
    axes.annotate(
        f"tolerance {level:.2g}",
        (0.99, level),
        (0.0, 6.0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        size=NOTE,
        color=FAINT,
        ha="right",
    )

    def points(group: Sequence[Draft]) -> tuple[list[float], list[float]]:
        """Displacements in percent, and errors, at least `low`."""
        return [100.0 * d.displacement for d in group], [
            d.error if d.error > LEAST_ERROR else low for d in group
        ]

    kept = [draft for draft in drafts if draft.attempt == chosen]
    hollow: dict[str, Any] = {"color": DARK, "linestyle": "", "mfc": "white", "clip_on": False}
    if kept:
        axes.plot(*points(kept), marker="o", ms=28.0, mew=2.0, label="this die", **hollow)
    came = "the surface as it came"
    axes.plot([0.0], [max(before, low)], marker="*", ms=20.0, mew=2.0, label=came, **hollow)
    names = {
        None: "as wanted",
        Status.OFF_TARGET: "odds off",
        Status.SELF_INTERSECTING: "meets itself",
        Status.TOO_NEAR: f"outcomes nearer than {trade_off.apart_deg:g}°",
        Status.TIPPY: f"left at less than {trade_off.margin_deg:g}°",
    }
    worst = {draft.attempt: next(trade_off.flaws(draft), None) for draft in drafts}
    for status, name in names.items():
        group = [draft for draft in drafts if worst[draft.attempt] is status]
        if group:
            label, style = f"{name} ({len(group)})", STYLES[status]
            axes.plot(*points(group), linestyle="", clip_on=False, label=label, **style)
    first = [*kept, *(draft for draft in drafts if draft.attempt != chosen)]
    _number_points(axes, zip([d.attempt for d in first], *points(first), strict=True))
    _put_legend_below(axes)
    return sheet


@styled
def pareto_chart(
    trials: Sequence[Mapping[str, Any]], front: Collection[int], named: Sequence[int]
) -> Sheet:
    """Smallest circle of each die of a search against its momentum margin.

    Parameters
    ----------
    trials: at least one, each with "number", "status" ("converged", or another where the die is not
        as wanted), "inradius_mm" and "margin_deg", at least 0, both None where there is nothing
        to measure; those are only counted.
    front: numbers of converged trials that no other beats in both; they are joined by steps.
    named: numbers of converged trials that are written beside their points, the first first; one
        that would cover an earlier one is left out.

    Raises
    ------
    InputError: there is no trial.
    """
    if not trials:
        raise InputError("trials: expected at least one, got none; run a trial")
    measured = [trial for trial in trials if trial["inradius_mm"] is not None]
    solved = [trial for trial in measured if trial["status"] == "converged"]
    missed = [trial for trial in measured if trial["status"] != "converged"]
    best = [trial for trial in solved if trial["number"] in front]
    beaten = [trial for trial in solved if trial["number"] not in front]

    def points(group: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
        return [t["inradius_mm"] for t in group], [t["margin_deg"] for t in group]

    sheet, axes = _scatter_sheet("radius of the smallest inscribed circle (mm)")
    axes.set(ylabel="momentum margin (°)", title="larger is better in both")
    limits = []
    for values in points(measured):
        low, high = min(values, default=0.0), max(values, default=1.0)
        room = 0.08 * (high - low) if high > low else 0.1 * max(high, 1.0)
        limits.append((max(low - room, 0.0), high + room))
    axes.set(xlim=limits[0], ylim=limits[1])
    if best:
        radii, margins = points(sorted(best, key=lambda trial: -trial["margin_deg"]))
        x, y = [axes.get_xlim()[0], *np.repeat(radii, 2)], [*np.repeat(margins, 2), 0.0]
        axes.plot(x, y, color=ACCENT, linewidth=2.5)
    for group, label, style in (
        (missed, "not converged", {"color": FAINT, "marker": "x", "mew": 3.0}),
        (beaten, "converged", {"color": PALE, "marker": "o", "ms": 13.0}),
        (best, "Pareto front: no die beats it in both", {"color": ACCENT, "marker": "o"}),
    ):
        label = f"{label} ({len(group)})"
        axes.plot(*points(group), linestyle="", clip_on=False, label=label, **style)
    if len(trials) > len(measured):
        label = f"nothing to measure ({len(trials) - len(measured)})"
        axes.plot([], [], linestyle="", label=label)
    by_number = {trial["number"]: trial for trial in solved}
    _number_points(axes, zip(named, *points([by_number[k] for k in named]), strict=True))
    _put_legend_below(axes)
    return sheet


def _scatter_sheet(x_label: str) -> tuple[Sheet, Axes]:
    sheet = Sheet(1215.0, 740.0, grows=True)
    axes = sheet.axes(130.0, 60.0, 1175.0, 645.0)
    axes.set_xlabel(x_label)
    axes.grid()
    return sheet, axes


def _put_legend_below(axes: Axes) -> None:
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)


def _number_points(axes: Axes, points: Iterable[tuple[int, float, float]]) -> None:
    """Write numbers beside points, each a number, x and y, the first first; one that would cover an
    earlier one is left out."""
    room, written = np.array([37.0, 21.0]), np.zeros((0, 2))
    for number, x, y in points:
        place = axes.transData.transform((x, y))
        if not (np.abs(place - written) < room).all(axis=1).any():
            written = np.vstack([written, place])
            axes.annotate(str(number), (x, y), (9, 6), textcoords="offset points", size=NOTE)
