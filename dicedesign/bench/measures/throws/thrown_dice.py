"""Dice that are designed for throws: total variation before and after, and on other tables."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from dicedesign.bench.measures.recipes import (
    begun,
    checked,
    designed,
    engraved,
    on_table,
    with_method,
)
from dicedesign.bench.rows import Row
from dicedesign.errors import DiceError, InputError
from dicedesign.optimize.options import ExactOptions, RefineOptions
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.bias import OFTEN
from dicedesign.throws.distances import MeasuredDistance, measure_variation, total_variation
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.simulation import Throws, simulate
from dicedesign.throws.table_terms import other_tables
from dicedesign.throws.tables import Table, posterior_tables, table_named

__all__ = [
    "FRESH",
    "DieThrows",
    "TableThrows",
    "Thrower",
    "ThrownRow",
    "refinement_of",
    "throw_recipe",
]

FRESH: Final = 2**64
"""First seed of the bench's throws, beyond all that designs and their verdicts take."""

SEEDS: Final = 100
"""Seeds of throws between those of one recipe's seed and the next."""

CONFIDENCE: Final = 0.95
"""Of intervals."""


SERIES: Final = 200
"""Series of throws of a perfect die that are drawn, to see what chance alone shows."""


@dataclass(frozen=True)
class DieThrows:
    """One design, and its throws on the table of the recipe.

    Attributes
    ----------
    status: of the design. seconds: on the wall, of its "design", of making the "file" with labels,
        and of the "throws" of the finished die.
    rounds: of throws and new designs that it took; round_drops: throws in all of them, onto all
        tables.
    symmetry: point group that it was designed with, or None.
    engraved: whether the die was thrown with its labels cut.
    drops: fresh ones; lost: of these, those that ended on no outcome.
    to_target: total variation of the fresh throws from the target.
    geometric, momentum: total variation between the odds of that model and the frequencies.
    """

    status: Status
    seconds: dict[str, float]
    rounds: int
    round_drops: int
    symmetry: str | None
    engraved: bool
    drops: int
    lost: int
    to_target: MeasuredDistance
    geometric: float
    momentum: float


@dataclass(frozen=True)
class TableThrows:
    """Throws of the refined die on what the table may be instead.

    Attributes
    ----------
    table: its numbers by name.
    drops: how many; lost: of these, those that ended on no outcome.
    to_target: total variation from the target.
    """

    table: dict[str, Any]
    drops: int
    lost: int
    to_target: MeasuredDistance


@dataclass(frozen=True)
class ThrownRow(Row):
    """One recipe with one seed.

    Attributes
    ----------
    name, seed, table_name: of the recipe; engine: of the fresh throws.
    within: total variation that the recipe asks for.
    before: the die designed for odds without momentum; None where that was not asked for. after:
        the recipe's own. None where there is none to throw.
    elsewhere: the latter on other tables.
    chance: what a perfect die shows there on the mean, where nine tables in ten are no worse, and
        where it is the worst.
    note: what is wrong, or "".
    """

    printed: ClassVar[bool] = False
    computed: ClassVar[tuple[str, ...]] = ("often", "worst", "missed")

    name: str
    seed: int
    table_name: str
    engine: str
    within: float
    before: DieThrows | None = None
    after: DieThrows | None = None
    elsewhere: tuple[TableThrows, ...] = ()
    chance: tuple[float, float] | None = None
    note: str = ""

    @property
    def often(self) -> float | None:
        """Total variation that nine in ten of the other tables do not exceed."""
        found = [one.to_target.value for one in self.elsewhere]
        return float(np.quantile(found, OFTEN)) if found else None

    @property
    def worst(self) -> float | None:
        """The largest there."""
        return max((one.to_target.value for one in self.elsewhere), default=None)

    @property
    def missed(self) -> bool:
        """Whether there is no such die, or it is beyond `within` and chance is not the reason."""
        after = self.after
        if after is None or after.status is not Status.CONVERGED:
            return True
        return after.to_target.interval[0] > self.within


def refinement_of(recipe: Recipe) -> tuple[ExactOptions, RefineOptions]:
    """The options of a recipe that this is about. Raises InputError: its method is another."""
    exact = recipe.method.exact
    if exact is None or exact.refine is None:
        method = recipe.method.name
        if exact is not None:
            method += f" with odds: {exact.odds}" + ", without refine" * (exact.odds == "thrown")
        raise InputError(
            f"{recipe.name}: expected method: {{exact: {{odds: thrown, refine: {{}}}}}}, got "
            f"{method}; change the method, or leave the recipe out"
        )
    return exact, exact.refine


@dataclass
class Thrower:
    """Throws with random numbers that nothing else has used.

    Attributes
    ----------
    engine: of the throws; workers: who run them.
    on_drops: called with the drops of each of their tasks that ended; on_quiet: as in `simulate`.
    throw: `simulate`, or one like it.
    seed: of the next series.
    """

    engine: str
    workers: Executor
    on_drops: Callable[[int], None] = lambda count: None
    on_quiet: Callable[[], None] | None = None
    throw: Callable[..., Throws] = simulate
    seed: int = FRESH

    def counts(self, die: _Printed, table: Table, drops: int) -> Integers:
        """(k + 1,) of the outcomes, and of drops that ended on none. Raises DiceError: all did."""
        throws = self.throw(
            die.thrown.body,
            table,
            drops,
            self.seed,
            engine=self.engine,
            workers=self.workers,
            progress=self.on_drops,
            on_quiet=self.on_quiet,
        )
        self.seed += 1
        counts: Integers = die.thrown.counts(throws)
        if not counts[:-1].any():
            raise DiceError(
                f"throws: expected drops that end on a facet with a label, got none of {drops}; "
                "see whether the table makes sense for such a die"
            )
        return counts


def throw_recipe(
    recipe: Recipe,
    drops: int,
    table_drops: int,
    thrower: Thrower,
    most: tuple[int, int] | None = None,
    *,
    is_compared: bool = True,
    on_stage: Callable[[str], None] = lambda stage: None,
) -> ThrownRow:
    """Design the die of a recipe, and one for odds without momentum, and throw both.

    Parameters
    ----------
    drops: of each die. table_drops: of the former on each of the other tables.
    most: drops of the first round and rounds that a design may take; None for what its recipe says.
    is_compared: whether there is one for odds without momentum.
    on_stage: called with what begins.

    Raises InputError: as `refinement_of`.
    """
    exact, refine = refinement_of(recipe)
    if most is not None:
        refine = replace(
            refine, drops=min(refine.drops, most[0]), rounds=min(refine.rounds, most[1])
        )
    thrower.seed = FRESH + SEEDS * recipe.seed
    row = ThrownRow(recipe.name, recipe.seed, exact.thrown_onto, thrower.engine, refine.within)
    try:
        if is_compared:
            on_stage("design without momentum")
            resting = _Printed(recipe, replace(exact, odds="resting", refine=None))
            row = replace(row, before=resting.judged(thrower, drops))
        on_stage("design for throws")
        refined = _Printed(recipe, replace(exact, refine=refine))
        row = replace(row, after=refined.judged(thrower, drops))
        on_stage("other tables")
        tables = posterior_tables(exact.thrown_onto) or other_tables(table_named(exact.thrown_onto))
        for table in tables:
            counts = thrower.counts(refined, table.lifted(refined.thrown.table.size), table_drops)
            lost = table_drops - int(counts[:-1].sum())
            thrown = TableThrows(table.as_dict(), table_drops, lost, refined.to_target(counts))
            row = replace(row, elsewhere=(*row.elsewhere, thrown))
        if tables:
            target = refined.work.target.probabilities
            row = replace(row, chance=_chance(target, table_drops, len(tables)))
    except DiceError as error:
        row = replace(row, note=str(error))
    return row


def _chance(target: Floats, drops: int, tables: int) -> tuple[float, float]:
    """See `ThrownRow.chance`, for a target (k,), and so many throws onto each of so many tables."""
    counts = np.random.default_rng(0).multinomial(drops, target, (SERIES, tables))
    found = np.abs(counts / drops - target).sum(axis=2) / 2.0
    return float(np.quantile(found, OFTEN, axis=1).mean()), float(found.max(axis=1).mean())


class _Printed:
    """A die designed by other options of a recipe's method, ready to be thrown as it is printed."""

    def __init__(self, recipe: Recipe, exact: ExactOptions) -> None:
        started = time.perf_counter()
        self.work = begun(with_method(recipe, exact=exact))
        designed(self.work)
        self.seconds = {"design": time.perf_counter() - started}
        checked(self.work)
        self.is_engraved = engraved(self.work)
        self.seconds["file"] = time.perf_counter() - started - self.seconds["design"]
        self.thrown = on_table(self.work)
        self.momentum = self.thrown.momentum(momentum_model(exact.thrown_onto))

    def to_target(self, counts: Integers) -> MeasuredDistance:
        """Total variation of counts (k + 1,) from the target."""
        return measure_variation(counts, np.append(self.work.target.probabilities, 0.0), CONFIDENCE)

    def judged(self, thrower: Thrower, drops: int) -> DieThrows:
        """Throw it so many times on the table of the recipe."""
        thrown, rounds, started = self.thrown, self.work.die.rounds, time.perf_counter()
        counts = thrower.counts(self, thrown.table, drops)
        frequencies = counts[:-1] / counts.sum()
        geometric = thrown.outcomes.sums(thrown.poses.probabilities)
        return DieThrows(
            status=self.work.status,
            seconds={**self.seconds, "throws": time.perf_counter() - started},
            rounds=len(rounds),
            round_drops=sum(one.drops + one.elsewhere_drops for one in rounds),
            symmetry=self.work.recipe.symmetry,
            engraved=self.is_engraved,
            drops=drops,
            lost=drops - int(counts[:-1].sum()),
            to_target=self.to_target(counts),
            geometric=total_variation(geometric, frequencies),
            momentum=total_variation(self.momentum, frequencies),
        )
