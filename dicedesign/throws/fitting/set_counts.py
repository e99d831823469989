"""Simulated throws of several dice at several sets of throw parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from itertools import chain
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.workers import in_order
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.fitting.sessions import simulated_table
from dicedesign.throws.simulation.simulation import simulate
from dicedesign.throws.tables import Table

__all__ = ["outcome_counts", "set_counts"]

COUNTS: Final = "counts"
"""Rows of a checkpoint: what came up with each die for each set of parameters."""


def set_counts(
    dice: Sequence[CountedDie],
    start: Table,
    sets: Floats,
    drops: int,
    seed: int,
    first: int,
    workers: Executor,
    checkpoint: Checkpoint,
    progress: Callable[[int], None] | None,
) -> list[Integers]:
    """Counts (n, g) of each die, thrown at n points of the unit cube of simulated sets.

    Parameters
    ----------
    start: has the name of the tables. drops: of each die for each set; seed: of all sets.
    first: number of the first of the points among all, which makes their seeds.
    checkpoint: what it has is taken from it, and what is simulated is added.
    progress: called with the number of drops of each die that was thrown.
    """
    tasks = []
    for number, point in enumerate(sets, start=first):
        table = simulated_table(start, point)
        tasks += [
            partial(outcome_counts, die, table, drops, (seed, number, i))
            for i, die in enumerate(dice)
        ]
    begun = first * len(dice)
    known = list(checkpoint.rows(COUNTS)[begun : begun + len(tasks)])
    counts: list[list[Integers]] = [[] for _ in dice]
    for place, came in enumerate(chain(known, in_order(tasks[len(known) :], workers))):
        die = place % len(dice)
        if place >= len(known):
            checkpoint.add(COUNTS, [came])
        checkpoint.require(len(came) == len(dice[die].labels))
        counts[die].append(came)
        if progress is not None:
            progress(drops)
    return [np.array(rows, dtype=np.int64) for rows in counts]


def outcome_counts(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> Integers:
    """Counts (g,) of a die's outcomes on a table, as a die of its size.

    drops: how often it is thrown; seed: one of several numbers, from which different ones are
    unrelated.
    """
    (own,) = np.random.SeedSequence(seed).generate_state(1).tolist()
    return die.by_outcome(simulate(die.body, table, drops, own).counts)
