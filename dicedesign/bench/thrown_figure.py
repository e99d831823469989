"""Dice that are designed for throws, in one figure: before, after and on changed tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.bench.measures.thrown_dice import Extent
from dicedesign.bench.measures.thrown_rows import ThrownRow
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["thrown_figure"]

HALF_MARK = 0.28
"""Of a noise floor, over the distance of two rows."""

CHANGES_BELOW = 0.2
"""Of the dots of changed tables, over the same."""


def thrown_figure(rows: Sequence[ThrownRow], extent: Extent) -> Figure:
    """Total variation from the target of each die, on one line.

    Raises InputError: no die was thrown.
    """
    from dicedesign.report.charts.palette import ACCENT, DARK, FAINT, PALE
    from dicedesign.report.charts.png import agg_figure

    thrown = [row for row in rows if row.after is not None]
    if not thrown:
        raise InputError("dice: expected at least one that was thrown, got none; see the notes")
    figure = agg_figure(8.4, 1.7 + 0.55 * len(thrown))
    height = figure.get_figheight()
    axes = figure.add_axes((0.2, 1.05 / height, 0.77, 1.0 - 1.45 / height))
    lines = np.arange(len(thrown))[::-1]
    for line, row in zip(lines, thrown, strict=True):
        after = row.after
        assert after is not None
        found = after.to_target
        if row.before is not None:
            before = row.before.to_target.value
            axes.plot([before, found.value], [line, line], color=PALE, linewidth=1.4, zorder=1)
            axes.scatter(before, line, s=52, color=PALE, zorder=3, label="without momentum")
        changed = [change.to_target.value for change in row.changes]
        axes.scatter(
            changed,
            np.full(len(changed), line - CHANGES_BELOW),
            s=11,
            color=FAINT,
            linewidths=0.0,
            zorder=2,
            label=f"for throws, a parameter ±{100.0 * extent.variation:g} % "
            f"({extent.variation_drops:,} drops)",
        )
        axes.plot(found.interval, [line, line], color=ACCENT, linewidth=2.6, alpha=0.45, zorder=3)
        axes.scatter(
            found.value, line, s=52, color=ACCENT, zorder=4, label="for throws, 95 % interval"
        )
        axes.vlines(
            found.noise_floor,
            line - HALF_MARK,
            line + HALF_MARK,
            color=DARK,
            linewidth=1.2,
            zorder=5,
            label="mean of a perfect die",
        )
    axes.set_yticks(lines, [row.name for row in thrown], parse_math=False)
    axes.set_ylim(-0.6, len(thrown) - 0.4)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("total variation from the target")
    axes.xaxis.grid(visible=True, color=PALE, alpha=0.4, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title(
        f"{extent.drops:,} throws of each die, before and after", fontsize=11, color=DARK
    )
    handles, labels = axes.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    figure.legend(
        list(named.values()), list(named), loc="lower center", ncols=2, frameon=False, fontsize=9
    )
    return figure
