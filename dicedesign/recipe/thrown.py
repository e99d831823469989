"""`method: exact` with thrown odds: the exact method by a momentum model, corrected by throws."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import asdict, replace
from itertools import islice
from typing import Final

import numpy as np

from dicedesign.errors import NoStartError
from dicedesign.fabricate.die import Design
from dicedesign.geometry.meshes.body import make_body
from dicedesign.gradient.odds_model import TableSensitivity, ThrownOdds
from dicedesign.optimize.coordinates.linked import orbits_of_directions
from dicedesign.optimize.options import MOST_ROUNDS, RefineOptions
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.refinement.rounds import Refinement, Thrown, shape_measures
from dicedesign.optimize.result import DesignResult
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.optimize.starts.start import Start
from dicedesign.recipe.convex import (
    designed_die,
    exact_options,
    normalised_center,
    solver,
    starts_of,
    wanted_odds,
)
from dicedesign.recipe.pipeline import Work
from dicedesign.results.parts import OtherTables, RoundOfThrows, Status
from dicedesign.results.parts import ThrownOdds as ThrownSection
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.bias import Series, variations_on_tables
from dicedesign.throws.momentum_model import (
    MomentumModel,
    momentum_model,
    other_tables,
    table_measures,
)
from dicedesign.throws.simulation import DieOnTable, ThrownDie, Throws, throwing_threads
from dicedesign.throws.tables import Table, posterior_tables, table_named

ON_TABLES: Final = 0.5
"""Throws onto what the table may be instead, all together, over those onto the table itself."""

FURTHER: Final = 3
"""Dice of other shapes that are made besides the first, of which the steadiest is taken."""

VERDICT: Final = MOST_ROUNDS + 1 + FURTHER
"""Number of the throws that judge the finished die, after those of all rounds and shapes."""

SERIES: Final = 1000
"""Seeds of a round: of its throws onto the table that is meant, and onto each of the others."""

SEEDS: Final = SERIES * (VERDICT + 1)
"""Seeds of throws between those of one recipe's seed and the next."""

CLOSE_STARTS: Final = 12
"""Variations of a die that are led to corrected odds, until one gets there: the momentum model has
kinks, at which some get stuck."""


def design_for_table(work: Work) -> Design:
    """The die of a recipe by the momentum model of its table, corrected by rounds of throws where
    the recipe asks for them. Raises InputError as `exact.design`, or as the start does."""
    wanted, options = wanted_odds(work.recipe), exact_options(work.recipe)
    thrown = ThrownOdds.on(options.thrown_onto)
    others = other_tables(table_named(options.thrown_onto), posterior_tables(options.thrown_onto))
    sensitivity = TableSensitivity(thrown, others, wanted)
    starts = iter(starts_of(work, wanted))
    result = solver(work)(starts, wanted, sensitivity=sensitivity)
    rounds: tuple[RoundOfThrows, ...] = ()
    if options.refine is not None and result.status is Status.CONVERGED:
        with throwing_threads() as workers:
            corrections = _Corrections(work, wanted, sensitivity, workers)
            result, rounds = corrections.refined(result, starts)
    return designed_die(work, result, rounds)


class _Corrections:
    """Rounds of throws of a recipe's dice at their printed size, and new designs."""

    def __init__(
        self, work: Work, wanted: Floats, sensitivity: TableSensitivity, workers: Executor
    ) -> None:
        self._work, self._wanted, self._sensitivity = work, wanted, sensitivity
        self._options, self._solve = exact_options(work.recipe), solver(work)
        self._center = normalised_center(work.recipe, work.start)
        self._name, self._workers = self._options.thrown_onto, workers
        self._model = momentum_model(self._name)
        self._others: tuple[Table, ...] = ()
        is_free = len(np.unique(wanted)) > 1 or work.recipe.group() is None
        if self._options.prefer.robustness > 0.0 and sensitivity.is_known and is_free:
            self._others = posterior_tables(self._name) or sensitivity.tables

    def refined(
        self, die: DesignResult, starts: Iterator[Start | None]
    ) -> tuple[DesignResult, tuple[RoundOfThrows, ...]]:
        """The die that the rounds lead to, and the rounds; from one, or from the steadiest of some
        that further starts lead to."""
        if self._work.start is None and self._others:
            dice = [die, *self._further(starts)]
            swings = [self._rounds(one).swing(one, place) for place, one in enumerate(dice)]
            die = dice[int(np.argmin(swings))]
        return self._rounds(die).refine(die)

    def _rounds(self, die: DesignResult) -> Refinement:
        """Rounds of dice like one."""
        refine, group = self._options.refine, self._work.recipe.group()
        assert refine is not None
        orbits = np.arange(len(self._wanted))
        if group is not None:
            orbits = orbits_of_directions(die.directions, group)
        return Refinement(
            target=self._wanted,
            orbits=orbits,
            tables=table_measures(table_named(self._name), self._others),
            drops=refine.drops,
            rounds=refine.rounds,
            within=refine.within,
            throw=self._throw,
            throw_on_tables=self._throw_on_tables,
            design=self._again,
            measures=lambda tried: shape_measures(tried, self._center),
            on_round=self._work.listeners.on_round,
        )

    def _further(self, starts: Iterator[Start | None]) -> Iterator[DesignResult]:
        """Dice with the odds by the model, of other shapes."""
        for _ in range(FURTHER):
            few = islice(starts, CLOSE_STARTS)
            try:
                found = self._solve(few, self._wanted, sensitivity=self._sensitivity)
            except NoStartError:
                continue
            if found.status is Status.CONVERGED:
                yield found

    def _throw(self, die: DesignResult, drops: int, number: int) -> Thrown:
        """See `Refinement`."""
        refine, on_table = self._options.refine, self._on_table(die)
        assert refine is not None
        seed = seed_of(self._work.recipe.seed, number)
        throws = on_table.simulated(drops, seed, refine.engine, self._workers)
        return Thrown(on_table.counts(throws), on_table.momentum(self._model))

    def _throw_on_tables(self, die: DesignResult, drops: int, number: int) -> list[Thrown]:
        """See `Refinement`."""
        refine, on_table = self._options.refine, self._on_table(die)
        assert refine is not None
        seed = seed_of(self._work.recipe.seed, number, is_elsewhere=True)
        counts = on_table.counts_on(self._others, drops, seed, refine.engine, self._workers)
        return [
            Thrown(count, on_table.momentum(self._model and self._model.near(table)))
            for count, table in zip(counts, self._others, strict=True)
        ]

    def _on_table(self, die: DesignResult) -> DieOnTable:
        """A die at its printed size."""
        scale = self._work.recipe.size_mm / die.hull.diameter
        center = None if self._center is None else scale * self._center
        solid = make_body(scale * die.hull.vertices, name="die")
        return DieOnTable.of(solid, center, die.directions, table_named(self._name))

    def _again(self, die: DesignResult, odds: Floats, bias: Floats | None) -> DesignResult | None:
        """A die near one, with other odds (k,) by the model; see `Refinement.design`."""
        recipe, sensitivity, options = self._work.recipe, self._sensitivity, self._options
        near = shapes_like(Start(die.hull.vertices, die.directions), recipe.seed, recipe.group())
        if bias is None:
            options = replace(options, prefer=Preferences())
        elif self._others:
            places = [self._others.index(table) for table in sensitivity.tables]
            sensitivity = replace(sensitivity, bias=bias[places])
        close = islice(near, CLOSE_STARTS)
        try:
            result = self._solve(close, odds, sensitivity=sensitivity, options=options)
        except NoStartError:
            return None
        return result if result.status is Status.CONVERGED else None


def seed_of(seed: int, number: int, *, is_elsewhere: bool = False) -> int:
    """The seed of a round's throws, of those onto other tables that of the first one's, for a
    recipe's seed; the verdict over the finished die has the number `VERDICT`."""
    return SEEDS * seed + SERIES * number + is_elsewhere


def throw(work: Work) -> None:
    """Throw the printed die with random numbers that no round of its design has used, if the recipe
    asks for throws, and judge it by them. One with labels is thrown with them, but where the center
    of mass was given nobody knows how they move it."""
    options, refine = exact_options(work.recipe), exact_options(work.recipe).refine
    die = DieOnTable.of(
        work.printed.body,
        work.solid.center_of_mass,
        work.die.directions,
        table_named(options.thrown_onto),
    )
    model, throws, elsewhere = momentum_model(options.thrown_onto), None, None
    if refine is not None:
        with throwing_threads() as workers:
            seed = seed_of(work.recipe.seed, VERDICT)
            throws = die.simulated(refine.verdict, seed, refine.engine, workers)
            elsewhere = _elsewhere(work, die, model, throws, refine, workers)
    work.thrown = ThrownDie(die, die.momentum(model), throws)
    measured = work.thrown.measured(work.target.probabilities)
    work.throws = ThrownSection(
        table=die.table.as_dict(),
        momentum=tuple(work.thrown.momentum.tolist()),
        rounds=work.die.rounds,
        simulated=measured,
        elsewhere=elsewhere,
    )
    if measured is None or refine is None:
        return
    told = (
        f"thrown {measured.drops} times, its total variation from the target is "
        f"{measured.total_variation:.2g}, where a perfect die shows {measured.noise_floor:.2g}"
    )
    if work.status is Status.CONVERGED and measured.total_variation > refine.within:
        work.status = Status.OFF_TABLE
    if work.status is Status.OFF_TABLE:
        work.remarks[:] = [work.status.value, told]
    else:
        work.remarks.insert(0, told)


def _elsewhere(
    work: Work,
    die: DieOnTable,
    model: MomentumModel | None,
    throws: Throws,
    refine: RefineOptions,
    workers: Executor,
) -> OtherTables | None:
    """What the die does on tables of the posterior; None where the table has none, or no
    momentum."""
    name = exact_options(work.recipe).thrown_onto
    tables = posterior_tables(name)
    if model is None or not tables:
        return None
    drops = math.ceil(ON_TABLES * refine.verdict / len(tables))
    seed = seed_of(work.recipe.seed, VERDICT, is_elsewhere=True)
    counts = die.counts_on(tables, drops, seed, refine.engine, workers)
    found = variations_on_tables(
        work.target.probabilities,
        table_measures(table_named(name), tables),
        [
            Series(die.momentum(model.near(table)), count[:-1])
            for table, count in zip(tables, counts, strict=True)
        ],
        Series(die.momentum(model), die.counts(throws)[:-1]),
    )
    return OtherTables(drops=drops * len(tables), **asdict(found))
