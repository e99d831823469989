"""Dice that are designed for throws: total variation before and after, and on changed tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import ClassVar, Final

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
from dicedesign.results.status import Status
from dicedesign.runtime.arrays import Integers
from dicedesign.throws.momentum.momentum_model import momentum_model
from dicedesign.throws.simulation.simulation import Throws, simulate
from dicedesign.throws.spreads import Spread, scaled
from dicedesign.throws.statistics.total_variation import (
    MeasuredDistance,
    measure_variation,
    total_variation,
)
from dicedesign.throws.tables import Table

__all__ = [
    "FRESH",
    "PARAMETERS",
    "Change",
    "DieThrows",
    "Thrower",
    "ThrownRow",
    "refinement_of",
    "throw_recipe",
]

PARAMETERS: Final = ("restitution", "friction", "height", "speed", "spin", "size")
"""Of a table, those that are varied."""

FRESH: Final = 2**64
"""First seed of the bench's throws, beyond all that designs and their verdicts take."""

SEEDS: Final = 100
"""Seeds of throws between those of one recipe's seed and the next."""

CONFIDENCE: Final = 0.95
"""Of intervals."""


@dataclass(frozen=True)
class DieThrows:
    """One design, and its throws on the table of the recipe.

    Attributes
    ----------
    status: of the design, which took `seconds` on the wall.
    rounds: of throws and new designs that it took; round_drops: throws in all of them.
    engraved: whether the die was thrown with its labels cut.
    drops: fresh ones; lost: of these, those that ended on no outcome.
    to_target: total variation of the fresh throws from the target.
    geometric, momentum: total variation between the odds of that model and the frequencies.
    """

    status: Status
    seconds: float
    rounds: int
    round_drops: int
    engraved: bool
    drops: int
    lost: int
    to_target: MeasuredDistance
    geometric: float
    momentum: float


@dataclass(frozen=True)
class Change:
    """Throws of the refined die on a table with one parameter changed.

    Attributes
    ----------
    parameter: one of `PARAMETERS`. factor: on it. value: that it has then, in SI
        units, or its range.
    drops: how many; lost: of these, those that ended on no outcome.
    to_target: total variation from the target.
    """

    computed: ClassVar[tuple[str, ...]] = ("above_noise",)

    parameter: str
    factor: float
    value: Spread
    drops: int
    lost: int
    to_target: MeasuredDistance

    @property
    def above_noise(self) -> float:
        """Total variation less what chance adds in the square."""
        return math.sqrt(max(self.to_target.value**2 - self.to_target.noise_floor**2, 0.0))


@dataclass(frozen=True)
class ThrownRow(Row):
    """One recipe.

    Attributes
    ----------
    name, table_name: of the recipe; engine: of the fresh throws.
    within: total variation that the recipe asks for.
    before: the die designed for odds without momentum. after: the recipe's own. None where there is
        none to throw.
    changes: the latter on changed tables.
    left_out: changes that no table can have, and why.
    note: what is wrong, or "".
    """

    printed: ClassVar[bool] = False
    computed: ClassVar[tuple[str, ...]] = ("missed",)

    name: str
    table_name: str
    engine: str
    within: float
    before: DieThrows | None = None
    after: DieThrows | None = None
    changes: tuple[Change, ...] = ()
    left_out: tuple[str, ...] = ()
    note: str = ""

    @property
    def worst(self) -> Change | None:
        """The change with the largest total variation."""
        return max(self.changes, key=lambda change: change.to_target.value, default=None)

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
    variation_drops: int,
    variation: float,
    thrower: Thrower,
    most: tuple[int, int] | None = None,
    on_stage: Callable[[str], None] = lambda stage: None,
) -> ThrownRow:
    """Design the die of a recipe and one for odds without momentum, and throw both.

    Parameters
    ----------
    drops: of each die. variation_drops: on each changed table.
    variation: part of each parameter that is taken away or added, in (0, 1).
    most: drops of a round and rounds that a design may take; None for what its recipe says.
    on_stage: called with what begins.

    Raises InputError: as `refinement_of`.
    """
    exact, refine = refinement_of(recipe)
    if most is not None:
        refine = replace(
            refine, drops=min(refine.drops, most[0]), rounds=min(refine.rounds, most[1])
        )
    thrower.seed = FRESH + SEEDS * recipe.seed
    row = ThrownRow(recipe.name, exact.table, thrower.engine, refine.within)
    try:
        on_stage("design without momentum")
        resting = _Printed(recipe, replace(exact, odds="resting", refine=None))
        row = replace(row, before=resting.judged(thrower, drops))
        on_stage("design for throws")
        refined = _Printed(recipe, replace(exact, refine=refine))
        row = replace(row, after=refined.judged(thrower, drops))
        on_stage("changed tables")
        for parameter, factor in _factors(variation):
            table = refined.thrown.table
            value = scaled(getattr(table, parameter), factor)
            try:
                table = Table(**{**table.as_dict(), parameter: value})
            except InputError as error:
                reason = f"{parameter} times {factor:g}: {error}"
                row = replace(row, left_out=(*row.left_out, reason))
                continue
            counts = thrower.counts(refined, table, variation_drops)
            lost = variation_drops - int(counts[:-1].sum())
            to_target = refined.to_target(counts)
            change = Change(parameter, factor, value, variation_drops, lost, to_target)
            row = replace(row, changes=(*row.changes, change))
    except DiceError as error:
        row = replace(row, note=str(error))
    return row


def _factors(variation: float) -> Iterator[tuple[str, float]]:
    for parameter in PARAMETERS:
        yield parameter, 1.0 - variation
        yield parameter, 1.0 + variation


class _Printed:
    """A die designed by other options of a recipe's method, ready to be thrown as it is printed."""

    def __init__(self, recipe: Recipe, exact: ExactOptions) -> None:
        self.work = begun(with_method(recipe, exact=exact))
        self.seconds = designed(self.work)
        checked(self.work)
        self.is_engraved = engraved(self.work)
        self.thrown = on_table(self.work)
        self.momentum = self.thrown.momentum(momentum_model(exact.table))

    def to_target(self, counts: Integers) -> MeasuredDistance:
        """Total variation of counts (k + 1,) from the target."""
        return measure_variation(counts, np.append(self.work.target.probabilities, 0.0), CONFIDENCE)

    def judged(self, thrower: Thrower, drops: int) -> DieThrows:
        """Throw it so many times on the table of the recipe."""
        thrown, rounds = self.thrown, self.work.die.rounds
        counts = thrower.counts(self, thrown.table, drops)
        frequencies = counts[:-1] / counts.sum()
        geometric = thrown.outcomes.sums(thrown.poses.probabilities)
        return DieThrows(
            status=self.work.status,
            seconds=self.seconds,
            rounds=len(rounds),
            round_drops=sum(one.all_drops for one in rounds),
            engraved=self.is_engraved,
            drops=drops,
            lost=drops - int(counts[:-1].sum()),
            to_target=self.to_target(counts),
            geometric=total_variation(geometric, frequencies),
            momentum=total_variation(self.momentum, frequencies),
        )
