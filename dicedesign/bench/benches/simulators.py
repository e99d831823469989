"""Simulators against each other, and the package's own with finer steps and other contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, Option
from dicedesign.bench.rows import Row, column, plain

if TYPE_CHECKING:
    from dicedesign.bench.measures.throws.simulator_agreement import ThrownWays

__all__ = ["Extent", "PairRow", "pair_rows"]

KEY: Final = """
Total variation between the frequencies of a die's rests in two simulations, over the dice. chance:
the mean if both had the same odds, at these numbers of throws. beyond: dice above what chance
exceeds once in 100 times; limit: of the worst die. native: the package's own; again: with other
random numbers; stiff: how hard its contacts are, whose steps keep to the length of a bounce."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    random: random dice beside those that are given.
    drops: of each die in each way of the package's own simulator.
    other_drops: in MuJoCo and in Bullet.
    """

    random: int
    drops: int
    other_drops: int


@dataclass(frozen=True)
class PairRow(Row):
    """Two ways to simulate, over all dice: see `KEY`."""

    table: ClassVar[str | None] = "pairs"

    first: str = column("", -10)
    second: str = column("", -18)
    drops: tuple[int, int] = column("throws each", 16, lambda both: "{:,}, {:,}".format(*both))
    mean: float = column("mean", 9, ".4f")
    chance: float = column("chance", 9, ".4f")
    worst: float = column("worst", 9, ".4f")
    limit: float = column("limit", 9, ".4f")
    beyond: int = column("beyond", 8)
    dice: int = column("of", 4)
    worst_die: str = column("  worst die", 0)


@dataclass(frozen=True)
class DieRow(Row):
    """A die's counts; see `ThrownWays`."""

    table: ClassVar[str | None] = "dice"
    printed: ClassVar[bool] = False

    name: str
    counts: dict[str, list[int]]


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.throws.simulator_agreement import (
        WAYS,
        given_die,
        random_dice,
        throw_in_ways,
    )
    from dicedesign.bench.measures.throws.simulator_odds import installed_engines
    from dicedesign.throws.tables import table_named

    extent: Extent = run.extent
    table = table_named(run.options.table)
    engines, notes = installed_engines(("native", "mujoco", "bullet"))
    for note in notes:
        run.note(f"left out: {note}")
    dice = [given_die(path) for path in run.options.dice]
    run.begin("random dice")
    dice += random_dice(extent.random)
    ways = [way for way in WAYS if way.engine in engines]
    drops = dict.fromkeys(engines, extent.other_drops) | {"native": extent.drops}
    yield {"table": table.as_dict(), "left_out": notes}
    thrown = []
    with run.workers("dice", len(dice)) as workers:
        for one in throw_in_ways(dice, ways, drops, table, workers):
            run.advance()
            thrown.append(one)
            yield DieRow(one.name, plain(one.counts))
    yield f"total variation over {len(dice)} dice on {table.name}"
    yield from pair_rows(thrown)
    for way in ways:
        lost = sum(int(one.counts[way.name][-1]) for one in thrown)
        if lost:
            yield f"{way.name}: {lost} of {len(dice) * drops[way.engine]} throws came to no rest"
    yield KEY
    return True


def pair_rows(thrown: Sequence[ThrownWays]) -> Iterator[PairRow]:
    """A row for each two ways that all dice were thrown in."""
    from dicedesign.bench.measures.throws.simulator_agreement import PAIRS

    for first, second in PAIRS:
        if not all({first, second} <= one.counts.keys() for one in thrown):
            continue
        found = [one.variation(first, second) for one in thrown]
        worst = int(np.argmax([one.value for one in found]))
        yield PairRow(
            first=first,
            second=second,
            drops=tuple(int(thrown[0].counts[way].sum()) for way in (first, second)),  # type: ignore[arg-type]
            mean=float(np.mean([one.value for one in found])),
            chance=float(np.mean([one.noise_floor for one in found])),
            worst=found[worst].value,
            limit=found[worst].limit,
            beyond=sum(one.beyond_chance for one in found),
            dice=len(found),
            worst_die=f"  {thrown[worst].name}",
        )


BENCHES.register(
    Bench(
        name="simulators",
        line="simulators of throws against each other, other steps and contacts",
        description="Throw dice onto a table in the package's own simulator, in MuJoCo and in "
        "Bullet, and in the package's own also with a half and a quarter of its time step and with "
        "contacts half and twice as stiff; compare how often each rest comes up. Beside the dice "
        "that are given there are random ones of all kinds of `dicedesign bench momentum`. "
        "Simulators that are not installed are left out.",
        rows=_rows,
        full=Extent(random=10, drops=20_000, other_drops=20_000),
        quick=Extent(random=2, drops=500, other_drops=50),
        amounts=(
            Amount("random", "N", "dice beside the given ones"),
            Amount("drops", "N", "of each die, each time that the package's own simulator throws"),
            Amount("other_drops", "N", "of each die in MuJoCo and in Bullet"),
        ),
        options=(
            Option(
                "dice",
                "recipes (.yaml), whose dice are thrown without labels, or meshes",
                {"nargs": "*", "type": Path, "metavar": "DIE"},
            ),
            Option(
                "--table",
                "that they are thrown onto (default: board-game)",
                {"default": "board-game", "metavar": "NAME|FILE.json"},
            ),
        ),
        packages=("numpy", "scipy", "mujoco", "pybullet"),
        workers="dice at a time (default: one for each core)",
    )
)
