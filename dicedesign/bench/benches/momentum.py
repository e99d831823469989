"""The momentum model against simulated throws of dice that it was not fitted to, and against the
counts of printed ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, Option
from dicedesign.bench.rows import Row, column
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from benchmarks.training.random_throws import Deviation
    from dicedesign.report.charts.paper import Paper
    from dicedesign.throws.throw_counts import CountedDie

__all__ = [
    "DieRow",
    "Extent",
    "KindRow",
    "by_kind",
]

GOALS: Final = (0.02, 0.06)
"""Mean and worst total variation to simulated throws."""

KEY: Final = """
floor: what right odds would show at these numbers of drops or throws, on the mean. Seconds are
processor time; those of the Jacobian include the Jacobian of the odds without momentum."""


@dataclass(frozen=True)
class Extent:
    """How many random dice, and how many drops of each and of each printed die."""

    dice: int
    drops: int


@dataclass(frozen=True)
class KindRow(Row):
    """Means over dice of a kind, or of all, and the worst of them: total variation between the
    simulated frequencies and the odds without momentum, and those of the model; noise_floor: what
    right odds would show."""

    table: ClassVar[str | None] = None

    kind: str = column("", -23)
    dice: int = column("dice", 6)
    geometric: float = column("geometric", 11, ".4f")
    worst_geometric: float = column("worst", 8, ".3f")
    momentum: float = column("momentum", 10, ".4f")
    worst_momentum: float = column("worst", 8, ".3f")
    noise_floor: float = column("floor", 8, ".4f")


@dataclass(frozen=True)
class DieRow(Row):
    """One of the random dice; see `Deviation`."""

    table: ClassVar[str | None] = "random_dice"
    printed: ClassVar[bool] = False

    kind: str
    rests: int
    drops: int
    geometric: float
    momentum: float
    noise_floor: float


def _rows(run: Run) -> Items:
    from benchmarks.training.random_throws import deviation
    from dicedesign.bench.measures.throws.momentum_judging import (
        judge_printed_die,
        model_times,
        throw_unseen_dice,
    )
    from dicedesign.gradient.thrown_odds import ThrownOdds
    from dicedesign.throws.momentum_model import momentum_model
    from dicedesign.throws.simulation import check_throws
    from dicedesign.throws.tables import table_named

    extent, options = run.extent, run.options
    check_throws(extent.drops, 0, options.engine, "uniform")
    table, model = table_named(options.table), momentum_model(options.table)
    if model is None:
        raise InputError(
            f"--table {options.table}: expected a table on which dice have momentum, got one with "
            "drag; take another, such as board-game"
        )
    printed = _printed(options.throws, options.printed)
    with run.workers("dice", extent.dice + len(printed)) as workers:
        thrown = []
        for one in throw_unseen_dice(extent.dice, extent.drops, table, options.engine, workers):
            thrown.append(one)
            run.advance()
        judged = []
        for die in printed:
            judged.append(
                judge_printed_die(die, table, model, extent.drops, options.engine, workers)
            )
            run.advance()
    deviations = [deviation(one, model) for one in thrown]
    kinds = list(by_kind(deviations))
    yield {
        "table": table.as_dict(),
        "engine": options.engine,
        "kinds": {row.kind: row for row in kinds},
    }
    yield from (DieRow(**vars(one)) for one in deviations)
    yield (
        f"total variation to {extent.drops} drops of each die in the simulator {options.engine} "
        f"onto {table.name} (goal: {GOALS[0]:g} on the mean and {GOALS[1]:g} at worst)"
    )
    yield from kinds
    odds, jacobian = model_times([one.die for one in thrown], model, ThrownOdds.on(options.table))
    yield {"seconds": {"odds": odds, "jacobian": jacobian}}
    rests = sorted(one.rests for one in deviations)[len(deviations) // 2]
    yield (
        f"medians for a die whose Morse complex is known, of {rests} rests: odds "
        f"{1e3 * odds:.3f} ms, Jacobian {1e3 * jacobian:.3f} ms"
    )
    unresolved = sum(one.unresolved for one in thrown)
    yield {"unresolved": unresolved}
    if unresolved:
        yield f"{unresolved} drops came to no rest"
    for number, rows in enumerate(judged):
        if number == 0:
            yield ""
        yield from rows
        if rows[0].unresolved:
            yield f"{'':<33}{rows[0].unresolved} of {rows[0].drops} drops came to no rest"
    yield KEY
    return True


def _printed(throws: Path | None, names: str | None) -> tuple[CountedDie, ...]:
    from dicedesign.throws.throw_counts import read_throw_counts

    if throws is None:
        if names is not None:
            raise InputError(
                f"--printed {names}: expected the file of their throws beside it, got none; add "
                "--throws"
            )
        return ()
    return read_throw_counts(throws, names and [name.strip() for name in names.split(",")])


def by_kind(deviations: Sequence[Deviation]) -> Iterator[KindRow]:
    """All dice, and those of each kind that there are."""
    from benchmarks.training.random_dice import DICE_KINDS
    from benchmarks.training.random_throws import mean_deviations

    yield KindRow("all", **vars(mean_deviations(deviations)))
    for kind in DICE_KINDS:
        alike = [one for one in deviations if one.kind == kind]
        if alike:
            yield KindRow(kind, **vars(mean_deviations(alike)))


def _figure(rows: Sequence[Row], run: Run) -> Paper:
    """Bars of each die's total variation without momentum and by the model."""
    from dicedesign.bench.measures.throws.momentum_judging import RESTS
    from dicedesign.report.charts.deviation_bars import deviation_bars_figure

    dice = [row for row in rows if isinstance(row, DieRow)]
    return deviation_bars_figure(
        {
            "without momentum": np.array([die.geometric for die in dice]),
            "momentum model": np.array([die.momentum for die in dice]),
        },
        np.array([die.noise_floor for die in dice]),
        f"{len(dice)} random dice of {RESTS[0]} to {RESTS[1]} rests on the table "
        f"{run.options.table}",
        f"{run.extent.drops} simulated drops of each die; the model was not fitted to any of them",
    )


BENCHES.register(
    Bench(
        name="momentum",
        line="the momentum model against simulated throws of dice that it was not fitted to",
        description="Throw random dice with 7 to 13 rests onto a table, and compare how often each "
        "rest comes up with its odds without momentum and by the table's momentum model. Dice are "
        "drawn as `dicedesign table learn` draws them, but from another seed: three quarters are "
        "random polyhedra (half-spaces facing all ways, such ones stretched, hulls of points, and "
        "prisms, bipyramids, boxes and Platonic solids with their facets or corners moved), every "
        "eighth of them with its center of mass beside the centroid; a quarter are designed "
        "exactly for random odds, some with a symmetry.",
        rows=_rows,
        full=Extent(100, 20_000),
        quick=Extent(12, 1_000),
        amounts=(
            Amount("dice", "N", "how many"),
            Amount("drops", "N", "of each random and each printed die"),
        ),
        options=(
            Option(
                "--table",
                "with a momentum model (default: board-game)",
                {"default": "board-game", "metavar": "NAME|FILE.json"},
            ),
            Option(
                "--throws",
                "also compare with throws of printed dice, a file as of `dicedesign table fit`",
                {"type": Path, "metavar": "CSV"},
            ),
            Option(
                "--printed", "these dice of the file only (default: all)", {"metavar": "NAME,..."}
            ),
        ),
        packages=("numpy", "torch", "mujoco", "pybullet"),
        workers="dice at a time (default: one for each core)",
        engine=True,
        figure=_figure,
    )
)
