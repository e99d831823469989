"""Many throws of one body: where they end, whatever engine and however many workers ran them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.throws.orientations import Orientations, drop_weights, released
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.tables import Table

__all__ = ["DROPS_PER_TASK", "ENGINES", "Engine", "Throws", "simulate", "throw_task"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

Engine = Literal["native", "mujoco", "bullet"]

ENGINES: Final[tuple[Engine, ...]] = get_args(Engine)

_MODULES: Final[dict[Engine, str]] = {
    "native": "dicedesign.throws.native",
    "mujoco": "dicedesign.throws.mujoco_engine",
    "bullet": "dicedesign.throws.bullet_engine",
}

DROPS_PER_TASK: Final = 500
"""Drops that share a generator of random numbers, so that they fall alike whoever runs them."""


@dataclass(frozen=True)
class Throws:
    """Simulated throws of one body.

    Attributes
    ----------
    table: how it was thrown; engine: by which simulator; seed: of its random numbers.
    outcomes: (n,) the rest at which each drop ended, in the order of `RestPoses`; -1 for those that
        ended on no facet in time.
    weights: (n,) how much each drop counts, 1 on the mean.
    rests: how many rests the body has.
    """

    table: Table
    engine: Engine
    seed: int
    outcomes: Integers
    weights: Floats
    rests: int

    @property
    def drops(self) -> int:
        """How many in all."""
        return len(self.outcomes)

    @cached_property
    def counts(self) -> Integers:
        """(k,) drops that ended at each rest."""
        return np.bincount(self.outcomes[self.outcomes >= 0], minlength=self.rests)

    @cached_property
    def unresolved(self) -> int:
        """Drops that ended on an edge, stuck or still moving; they count for no rest."""
        return int(np.count_nonzero(self.outcomes < 0))

    @cached_property
    def frequencies(self) -> Floats:
        """(k,) of the rests among the drops that were resolved, by weight; NaN if none was."""
        landed = self.outcomes >= 0
        weights = self.weights[landed]
        total = np.bincount(self.outcomes[landed], weights, minlength=self.rests)
        with np.errstate(invalid="ignore"):
            frequencies: Floats = total / weights.sum()
        return frequencies


def simulate(
    body: RigidBody,
    table: Table,
    drops: int,
    seed: int = 0,
    *,
    engine: Engine = "native",
    orientations: Orientations = "uniform",
    refinement: float = 1.0,
    workers: Executor | None = None,
    progress: Callable[[int], None] | None = None,
) -> Throws:
    """Throw a body many times. Neither engine knows of the momentum-free model, except that a drop
    ends where that says it must.

    Parameters
    ----------
    drops: how many, above 0. seed: the same gives the same drops, in whatever number of workers.
    orientations: at which it is let go. refinement: divides the time step.
    workers: run tasks of `DROPS_PER_TASK` drops; None runs them here.
    progress: called with the number of drops of each task that ended.

    Raises
    ------
    InputError: the number of drops or the seed cannot be used, or the engine is not installed.
    """
    if drops < 1:
        raise InputError(f"drops: expected a whole number above 0, got {drops}; raise it")
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0, got {seed}; take another")

    def tasks() -> Iterator[tuple[int, int]]:
        for first in range(0, drops, DROPS_PER_TASK):
            yield first, min(DROPS_PER_TASK, drops - first)

    def run(task: tuple[int, int]) -> Integers:
        return throw_task(body, table, *task, seed, engine, orientations, refinement)

    outcomes = []
    if workers is None:
        for task in tasks():
            outcomes.append(run(task))
            _tell(progress, task[1])
    else:
        futures = [
            workers.submit(throw_task, body, table, *task, seed, engine, orientations, refinement)
            for task in tasks()
        ]
        for future in futures:
            outcomes.append(future.result())
            _tell(progress, len(outcomes[-1]))
    return Throws(
        table,
        engine,
        seed,
        np.concatenate(outcomes),
        drop_weights(drops, orientations),
        len(body.rest_heights),
    )


def _tell(progress: Callable[[int], None] | None, drops: int) -> None:
    if progress is not None:
        progress(drops)


def throw_task(
    body: RigidBody,
    table: Table,
    first: int,
    count: int,
    seed: int,
    engine: Engine,
    orientations: Orientations,
    refinement: float,
) -> Integers:
    """The rests (count,) of the drops from number `first` on, which is a multiple of
    `DROPS_PER_TASK`; -1 for those that found none."""
    rng = np.random.default_rng([seed, first // DROPS_PER_TASK])
    states = released(body, table, np.arange(first, first + count), orientations, rng)
    # Each engine loads a library of its own.
    engine_module = import_module(_MODULES[engine])
    outcomes: Integers = engine_module.throw_states(body, table, states, refinement)
    return outcomes
