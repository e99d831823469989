"""Real throws beside simulated ones: a test of a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.simulation.simulation import simulate
from dicedesign.throws.statistics.goodness_of_fit import (
    ChiSquareTest,
    MultinomialTest,
    chi_square,
    exact_multinomial,
    two_sample_chi_square,
)
from dicedesign.throws.statistics.intervals import jeffreys_means
from dicedesign.throws.tables import Table

__all__ = ["DieCheck", "check_table"]


@dataclass(frozen=True)
class DieCheck:
    """Real throws of one die beside simulated ones.

    Attributes
    ----------
    die: what was thrown.
    simulated: (g,) how often each outcome came up in simulation.
    unresolved: simulated drops that ended nowhere.
    chi_square: whether real and simulated throws can have the same odds, whatever these are.
    exact: whether the real ones can have the odds simulated, as if those were known.
    geometric: whether the real ones can have the odds without momentum.
    """

    die: CountedDie
    simulated: Integers
    unresolved: int
    chi_square: ChiSquareTest
    exact: MultinomialTest
    geometric: ChiSquareTest

    @property
    def odds(self) -> Floats:
        """(g,) simulated odds, above 0, by the prior of Jeffreys."""
        return jeffreys_means(self.simulated)


def check_table(
    dice: Sequence[CountedDie],
    table: Table,
    drops: int,
    seed: int,
    *,
    workers: Executor | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[DieCheck, ...]:
    """Throw each die so many times on a table, and compare.

    Parameters and errors: as of `simulate`. Dice whose size is unknown have the table's; larger
    ones than it lets fall are let go from as high as they are large.
    """
    checks = []
    for die in dice:
        lifted = table.lifted(die.size)
        throws = simulate(die.body, lifted, drops, seed, workers=workers, progress=progress)
        simulated = die.by_outcome(throws.counts)
        checks.append(
            DieCheck(
                die=die,
                simulated=simulated,
                unresolved=throws.unresolved,
                chi_square=two_sample_chi_square(die.counts, simulated),
                exact=exact_multinomial(die.counts, jeffreys_means(simulated)),
                geometric=chi_square(die.counts, die.geometric),
            )
        )
    return tuple(checks)
