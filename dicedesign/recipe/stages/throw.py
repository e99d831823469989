"""Stage throw: the finished die is thrown onto its table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.results.parts import Status

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from dicedesign.optimize.options import RefineOptions
    from dicedesign.results.parts import OtherTables
    from dicedesign.throws.momentum_model import MomentumModel
    from dicedesign.throws.simulation import DieOnTable, Throws

__all__ = ["throw"]

ON_TABLES: Final = 0.5
"""Throws onto what the table may be instead, all together, over those onto the table itself."""


def throw(work: Work) -> None:
    """Throw the printed die with random numbers that no round of its design has used, if the recipe
    asks for throws, and judge it by them. One with labels is thrown with them, but where the center
    of mass was given nobody knows how they move it."""
    from dicedesign.recipe.methods.exact import exact_options
    from dicedesign.recipe.methods.thrown import VERDICT, seed_of
    from dicedesign.results.parts import RoundOfThrows, ThrownOdds
    from dicedesign.throws.momentum_model import momentum_model
    from dicedesign.throws.simulation import DieOnTable, ThrownDie, throwing_threads
    from dicedesign.throws.tables import table_named

    options, refine = exact_options(work.recipe), exact_options(work.recipe).refine
    engraved = None if work.engraved is None else work.engraved.assessment
    verdict = engraved or work.plain
    die = DieOnTable.of(
        verdict.body,
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
    work.throws = ThrownOdds(
        table=die.table.as_dict(),
        momentum=tuple(work.thrown.momentum.tolist()),
        rounds=tuple(
            RoundOfThrows(
                drops=thrown.drops,
                deviation=thrown.deviation,
                noise_floor=thrown.noise_floor,
                expected=thrown.expected,
                elsewhere_drops=thrown.elsewhere_drops,
                elsewhere=thrown.elsewhere,
                is_kept=thrown.is_kept,
                asked=tuple(thrown.asked.tolist()),
                frequencies=tuple(thrown.frequencies.tolist()),
            )
            for thrown in work.die.rounds
        ),
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
    from dataclasses import asdict

    from dicedesign.recipe.methods.exact import exact_options
    from dicedesign.recipe.methods.thrown import VERDICT, seed_of
    from dicedesign.results.parts import OtherTables
    from dicedesign.throws.bias import Series, variations_on_tables
    from dicedesign.throws.table_terms import table_measures
    from dicedesign.throws.tables import posterior_tables, table_named

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


STAGES.register(
    Stage(
        name="throws",
        line="throws the printed die onto its table, with fresh random numbers",
        rank=70,
        wanted=lambda work: work.recipe.method.thrown,
        run=throw,
    )
)
