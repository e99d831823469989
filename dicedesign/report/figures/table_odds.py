"""What a die does on a table beside what was asked of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import ACCENT, DARK, FAINT, PALE
from dicedesign.report.charts.png import agg_figure
from dicedesign.throws.statistics.total_variation import total_variation

__all__ = ["refinement_figure", "table_odds_figure"]

_MOST_LEVEL_LABELS: Final = 24

_GROUP_WIDTH: Final = 0.84

_BAR_WIDTH: Final = 0.24

_MODEL: Final = "#f0b88f"
"""Of what is predicted of throws, paler than what was thrown."""


def table_odds_figure(
    labels: Sequence[str], target: ArrayLike, geometric: ArrayLike, thrown: Mapping[str, Any]
) -> Figure:
    """Bars of each outcome's odds, in front of a wide one of its target: without momentum, by the
    momentum model, and simulated, with exact intervals. Those that there are none of are left out.

    Parameters
    ----------
    labels: k outcomes, at least one.
    target, geometric: (k,) probabilities in [0, 1].
    thrown: perhaps with "momentum" (k,), and perhaps with "simulated", which has "drops",
        "frequencies" (k,), "intervals" (k, 2) of 95 %, "total_variation", its "interval" (2,) of
        95 % and "noise_floor".

    Raises
    ------
    InputError: there is no outcome, or not one of each probability for each.
    """
    simulated = thrown.get("simulated")
    series = [("without momentum", FAINT, geometric)]
    if "momentum" in thrown:
        series.append(("momentum model", _MODEL, thrown["momentum"]))
    if simulated is not None:
        series.append(("simulated throws", ACCENT, simulated["frequencies"]))
    lengths = [len(np.asarray(values)) for _, _, values in series]
    if not labels or {len(labels), len(np.asarray(target)), *lengths} != {len(labels)}:
        raise InputError(
            "table: expected at least one outcome, with one target and one probability of each "
            f"kind each, got {len(labels)} labels, {len(np.asarray(target))} targets and "
            f"{', '.join(map(str, lengths))} probabilities"
        )
    count = len(labels)
    figure = agg_figure(min(max(10.2, 0.75 * count + 1.2), 12.0), 4.4)
    axes = figure.add_axes((0.09, 0.16, 0.89, 0.70))
    places = np.arange(count)
    percent = 100.0 * np.asarray(target, dtype=np.float64)
    axes.bar(places, percent, _GROUP_WIDTH, color=PALE, alpha=0.55, label="target")
    axes.hlines(percent, places - _GROUP_WIDTH / 2, places + _GROUP_WIDTH / 2, colors=DARK, lw=1.0)
    for number, (name, color, values) in enumerate(series):
        shifted = places + (number - (len(series) - 1) / 2.0) * _BAR_WIDTH
        percent = 100.0 * np.asarray(values, dtype=np.float64)
        axes.bar(shifted, percent, _BAR_WIDTH, color=color, label=name)
    if simulated is not None:
        limits = 100.0 * np.asarray(simulated["intervals"], dtype=np.float64)
        axes.errorbar(
            shifted,
            percent,
            yerr=[percent - limits[:, 0], limits[:, 1] - percent],
            fmt="none",
            ecolor=DARK,
            elinewidth=1.1,
            capsize=2.5,
            label="exact 95 % interval",
        )
    # Room above the bars for the legend.
    axes.set_ylim(0.0, 1.2 * max(axes.dataLim.ymax, 1e-9))
    axes.set_xlim(-0.6, count - 0.4)
    rotation = 0 if count <= _MOST_LEVEL_LABELS else 90
    axes.set_xticks(places, labels, fontsize=9, rotation=rotation, parse_math=False)
    axes.set_xlabel("outcome (label on the facet that the die rests on)")
    axes.set_ylabel("probability (%)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper center", ncols=5, frameon=False, fontsize=8, columnspacing=1.2)
    if simulated is None:
        deviations = [f"{name} {total_variation(values, target):.4f}" for name, _, values in series]
        title = f"total variation to the target: {', '.join(deviations)}"
    else:
        title = _measured(simulated)
    axes.set_title(title, fontsize=10, color=DARK)
    return figure


def _measured(simulated: Mapping[str, Any]) -> str:
    low, high = simulated["interval"]
    return (
        f"{simulated['drops']:,} throws: total variation {simulated['total_variation']:.4f} "
        f"(95 %: {low:.4f} to {high:.4f}), a perfect die: {simulated['noise_floor']:.4f}"
    )


def refinement_figure(thrown: Mapping[str, Any]) -> Figure:
    """Total variation between simulated frequencies and the target, round by round, against the
    throws onto the table so far, with what a perfect die would show in as many as the round has.

    The first rounds may have throws onto a livelier and a duller table too, as many in all.

    The verdict over the finished die, where there is one, comes last, with its interval of 95 %.

    Parameters
    ----------
    thrown: with "rounds", at least one, each with "drops", "deviation", "noise_floor" and "changed"
        (a deviation on each changed table, or none), and perhaps with "simulated", see
        `table_odds_figure`.

    Raises
    ------
    InputError: there is no round.
    """
    rounds, simulated = thrown["rounds"], thrown.get("simulated")
    if not rounds:
        raise InputError("rounds: expected at least one, got none")
    drops = np.cumsum([entry["drops"] for entry in rounds], dtype=np.float64)
    deviations = [entry["deviation"] for entry in rounds]
    floors = [entry["noise_floor"] for entry in rounds]
    figure = agg_figure(8.4, 3.8)
    axes = figure.add_axes((0.10, 0.15, 0.87, 0.74))
    axes.plot(drops, deviations, color=ACCENT, marker="o", markersize=5, label="die of the round")
    changed = [entry["changed"] for entry in rounds if entry["changed"]]
    for number, marker, table in ((0, "^", "livelier"), (1, "v", "duller")):
        if changed:
            axes.plot(
                drops[: len(changed)],
                [pair[number] for pair in changed],
                color=ACCENT,
                alpha=0.55,
                linewidth=0.8,
                marker=marker,
                markersize=5,
                label=f"on a {table} table",
            )
    if simulated is not None:
        drops = np.append(drops, drops[-1] + simulated["drops"])
        floors.append(simulated["noise_floor"])
        value, (low, high) = simulated["total_variation"], simulated["interval"]
        axes.errorbar(
            drops[-1],
            value,
            yerr=[[value - low], [high - value]],
            fmt="D",
            color=DARK,
            markersize=6,
            elinewidth=1.1,
            capsize=3.0,
            label="finished die, with its 95 % interval",
        )
    axes.plot(drops, floors, color=FAINT, ls="--", marker=".", label="a perfect die")
    axes.set_xlim(0.0, 1.05 * drops[-1])
    axes.set_ylim(0.0, 1.1 * axes.dataLim.ymax)
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.set_xlabel("simulated throws onto the table so far")
    axes.set_ylabel("total variation to the target")
    axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="best", frameon=False, fontsize=9)
    axes.set_title("deviation from the target, round by round", fontsize=11, color=DARK)
    return figure
