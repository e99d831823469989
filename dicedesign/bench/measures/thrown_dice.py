"""Dice that are designed for throws: total variation before and after, and on changed tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from dicedesign.bench.measures.thrown_rows import Change, DieThrows, ThrownRow
from dicedesign.design.options import ExactOptions, RefineOptions
from dicedesign.errors import DiceError, EngravingError, InputError
from dicedesign.recipe.design_stage import DesignedDie, design_die, make_start, thrown_die
from dicedesign.recipe.on_table import DieOnTable
from dicedesign.recipe.run import engrave_die
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.recipe.table_summary import CONFIDENCE
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.simulation.simulation import simulate
from dicedesign.throws.statistics.total_variation import measure_variation, total_variation
from dicedesign.throws.tables import Table, table_named

__all__ = ["FULL", "PARAMETERS", "QUICK", "ROBUST", "Extent", "refinement_of", "throw_recipe"]

PARAMETERS: Final = ("restitution", "friction", "height", "speed", "spin", "size")
"""Of a table, those that are varied."""

ROBUST: Final = 0.02
"""Wanted of the total variation on a table with one parameter changed, chance aside."""

FRESH: Final = 2**64
"""First seed of the bench's throws, beyond all that designs and their verdicts take."""

SEEDS: Final = 100
"""Seeds of throws between those of one recipe's seed and the next."""


@dataclass(frozen=True)
class Extent:
    """How much is thrown.

    Attributes
    ----------
    drops: of each die, before and after. variation_drops: on each changed table.
    variation: part of each parameter that is taken away or added, in (0, 1).
    engine: of these throws; a design keeps to its own.
    round_drops, rounds: what a design may take at most; None for what its recipe says.
    """

    drops: int
    variation_drops: int
    variation: float
    engine: str = "native"
    round_drops: int | None = None
    rounds: int | None = None

    @property
    def all_drops(self) -> int:
        """For one recipe, if no change is left out."""
        return 2 * self.drops + 2 * len(PARAMETERS) * self.variation_drops


FULL: Final = Extent(100_000, 20_000, 0.2)

QUICK: Final = Extent(4_000, 1_000, 0.2, round_drops=2_000, rounds=1)


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


def throw_recipe(
    recipe: Recipe,
    extent: Extent,
    workers: Executor,
    on_stage: Callable[[str], None],
    on_drops: Callable[[int], None],
    on_quiet: Callable[[], None] | None = None,
) -> ThrownRow:
    """Design the die of a recipe and one for odds without momentum, and throw both.

    workers: run the throws that judge. on_stage: called with what begins; on_drops: with the drops
    of each of their tasks that ended; on_quiet: as in `simulate`. Raises InputError: as
    `refinement_of`.
    """
    exact, refine = refinement_of(recipe)
    if extent.round_drops is not None and extent.rounds is not None:
        refine = replace(
            refine,
            drops=min(refine.drops, extent.round_drops),
            rounds=min(refine.rounds, extent.rounds),
        )
    fresh = _Fresh(extent.engine, FRESH + SEEDS * recipe.seed, workers, on_drops, on_quiet)
    before: DieThrows | None = None
    after: DieThrows | None = None
    changes: list[Change] = []
    left_out: list[str] = []
    note = ""
    try:
        on_stage("design without momentum")
        resting = _Designed.of(recipe, replace(exact, odds="resting", refine=None))
        before = _judged(resting, fresh, extent.drops)
        on_stage("design for throws")
        refined = _Designed.of(recipe, replace(exact, refine=refine))
        after = _judged(refined, fresh, extent.drops)
        on_stage("changed tables")
        for parameter, factor in _factors(extent.variation):
            try:
                table = _changed(refined.thrown.table, parameter, factor)
            except InputError as error:
                left_out.append(f"{parameter} times {factor:g}: {error}")
            else:
                changes.append(_changed_throws(refined, table, parameter, factor, fresh, extent))
    except DiceError as error:
        note = str(error)
    return ThrownRow(
        name=recipe.name,
        table=exact.table,
        engine=extent.engine,
        within=refine.within,
        before=before,
        after=after,
        changes=tuple(changes),
        left_out=tuple(left_out),
        note=note,
    )


@dataclass(frozen=True)
class _Designed:
    """A die, ready to be thrown.

    Attributes
    ----------
    die: the design, which took `seconds` on the wall.
    engraved: whether it has its labels cut.
    thrown: what is thrown. momentum: (k,) odds of its outcomes by the momentum model.
    """

    die: DesignedDie
    seconds: float
    engraved: bool
    thrown: DieOnTable
    momentum: Floats

    @classmethod
    def of(cls, recipe: Recipe, exact: ExactOptions) -> _Designed:
        """The die of a recipe by other options of the method, as it is printed; without labels
        where they do not fit."""
        begun = time.perf_counter()
        given = _with(recipe, exact)
        start = make_start(given)
        die = design_die(given, start)
        seconds = time.perf_counter() - begun
        engraved = None
        if recipe.engrave is not None:
            try:
                engraved, _ = engrave_die(die, recipe.engrave, recipe.size_mm)
            except EngravingError:
                engraved = None
        # Without refinement nothing is thrown there.
        judged = thrown_die(
            _with(recipe, replace(exact, odds="thrown", refine=None)), die, start, engraved
        )
        verdict = die.verdict
        thrown = DieOnTable.of(
            judged.solid,
            None if verdict.uniform else judged.center_of_mass,
            verdict.hull.normals[verdict.facet_of_outcome],
            table_named(exact.table),
        )
        return cls(die, seconds, engraved is not None, thrown, judged.momentum)


def _with(recipe: Recipe, exact: ExactOptions) -> Recipe:
    """The recipe with other options of the method."""
    return recipe.model_copy(update={"method": recipe.method.model_copy(update={"exact": exact})})


@dataclass
class _Fresh:
    """Throws with random numbers that nothing else has used.

    Attributes
    ----------
    seed: of the next series.
    """

    engine: str
    seed: int
    workers: Executor
    on_drops: Callable[[int], None]
    on_quiet: Callable[[], None] | None

    def counts(self, thrown: DieOnTable, table: Table, drops: int) -> Integers:
        """(k + 1,) of the outcomes, and of drops that ended on none. Raises DiceError: all did."""
        throws = simulate(
            thrown.body,
            table,
            drops,
            self.seed,
            engine=self.engine,
            workers=self.workers,
            progress=self.on_drops,
            on_quiet=self.on_quiet,
        )
        self.seed += 1
        counts: Integers = thrown.counts(throws)
        if not counts[:-1].any():
            raise DiceError(
                f"throws: expected drops that end on a facet with a label, got none of {drops}; "
                "see whether the table makes sense for such a die"
            )
        return counts


def _judged(designed: _Designed, fresh: _Fresh, drops: int) -> DieThrows:
    die, thrown = designed.die, designed.thrown
    counts = fresh.counts(thrown, thrown.table, drops)
    frequencies = counts[:-1] / counts.sum()
    return DieThrows(
        status=die.status,
        seconds=designed.seconds,
        rounds=len(die.rounds),
        round_drops=sum(thrown.all_drops for thrown in die.rounds),
        engraved=designed.engraved,
        drops=drops,
        lost=drops - int(counts[:-1].sum()),
        to_target=measure_variation(counts, np.append(die.target.probabilities, 0.0), CONFIDENCE),
        geometric=total_variation(thrown.by_outcome(thrown.poses.probabilities), frequencies),
        momentum=total_variation(designed.momentum, frequencies),
    )


def _factors(variation: float) -> Iterator[tuple[str, float]]:
    for parameter in PARAMETERS:
        yield parameter, 1.0 - variation
        yield parameter, 1.0 + variation


def _changed(table: Table, parameter: str, factor: float) -> Table:
    """A table with one parameter multiplied. Raises InputError: there is no such table."""
    value = factor * getattr(table, parameter)
    return replace(table, **{parameter: value})


def _changed_throws(
    designed: _Designed,
    table: Table,
    parameter: str,
    factor: float,
    fresh: _Fresh,
    extent: Extent,
) -> Change:
    drops = extent.variation_drops
    counts = fresh.counts(designed.thrown, table, drops)
    return Change(
        parameter=parameter,
        factor=factor,
        value=getattr(table, parameter),
        drops=drops,
        lost=drops - int(counts[:-1].sum()),
        to_target=measure_variation(
            counts, np.append(designed.die.target.probabilities, 0.0), CONFIDENCE
        ),
    )
