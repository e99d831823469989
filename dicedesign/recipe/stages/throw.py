"""Stage throw: the finished die is thrown onto its table."""

from __future__ import annotations

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.results.status import Status

__all__ = ["throw"]


def throw(work: Work) -> None:
    """Throw the printed die with random numbers that no round of its design has used, if the recipe
    asks for throws, and judge it by them. One with labels is thrown with them, but where the center
    of mass was given nobody knows how they move it."""
    from dicedesign.recipe.methods.exact import exact_options
    from dicedesign.recipe.methods.thrown import SEEDS
    from dicedesign.results.throws import RoundOfThrows, ThrownOdds
    from dicedesign.throws.momentum.momentum_model import momentum_model
    from dicedesign.throws.simulation.die_on_table import DieOnTable, ThrownDie, throwing_threads
    from dicedesign.throws.tables import table_named

    options, refine = exact_options(work.recipe), exact_options(work.recipe).refine
    engraved = None if work.engraved is None else work.engraved.verdict
    verdict = engraved or work.plain
    die = DieOnTable.of(
        verdict.body,
        work.solid.center_of_mass,
        work.die.directions,
        table_named(options.thrown_onto),
    )
    throws = None
    if refine is not None:
        with throwing_threads() as workers:
            seed = SEEDS * work.recipe.seed + SEEDS - 1
            throws = die.simulated(refine.verdict, seed, refine.engine, workers)
    work.thrown = ThrownDie(die, die.momentum(momentum_model(options.thrown_onto)), throws)
    measured = work.thrown.measured(work.target.probabilities)
    work.details["thrown"] = ThrownOdds(
        table=die.table.as_dict(),
        momentum=tuple(work.thrown.momentum.tolist()),
        rounds=tuple(
            RoundOfThrows(
                drops=thrown.drops,
                deviation=thrown.deviation,
                noise_floor=thrown.noise_floor,
                changed=tuple(thrown.changed),
                asked=tuple(thrown.asked.tolist()),
                frequencies=tuple(thrown.frequencies.tolist()),
            )
            for thrown in work.die.rounds
        ),
        simulated=measured,
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


STAGES.register(
    Stage(
        name="throws",
        line="throws the printed die onto its table, with fresh random numbers",
        rank=70,
        wanted=lambda work: work.recipe.method.thrown,
        run=throw,
    )
)
