"""A die thrown onto its table: simulated throws and the momentum model, by outcome."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.geometry.meshes.body import Body
from dicedesign.rest.outcomes import OutcomeOdds, outcome_odds
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.results.parts import SimulatedThrows
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.intervals import exact_intervals
from dicedesign.throws.engines.engine import require_engine
from dicedesign.throws.momentum.momentum_model import MomentumModel
from dicedesign.throws.momentum.momentum_odds import momentum_odds
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.simulation.simulation import Throws, simulate
from dicedesign.throws.statistics.total_variation import measure_variation
from dicedesign.throws.tables import Table

__all__ = ["DieOnTable", "ThrownDie", "throwing_threads"]

CONFIDENCE: Final = 0.95
"""Of every interval."""


@dataclass(frozen=True, eq=False)
class DieOnTable:
    """A die in mm, ready to be thrown.

    Attributes
    ----------
    solid: as it is; body: the same about its center of mass.
    poses: its rests; outcomes: what they count for.
    table: with the die's own size.
    """

    solid: Body
    body: RigidBody
    poses: RestPoses
    outcomes: OutcomeOdds
    table: Table

    @classmethod
    def of(
        cls, solid: Body, center_of_mass: Floats | None, directions: Floats, table: Table
    ) -> DieOnTable:
        """A solid with center of mass (3,), None for the uniform one, whose outcomes have
        directions (k, 3)."""
        poses = rest_poses(solid, center_of_mass)
        body = rigid_body(solid, poses)
        sized = table.sized(2e-3 * body.radius)
        return cls(solid, body, poses, outcome_odds(poses, directions), sized)

    def momentum(self, model: MomentumModel | None) -> Floats:
        """(k,) odds of the outcomes by a momentum model; None for no momentum."""
        odds: Floats = self.outcomes.sums(momentum_odds(self.poses, self.body, model))
        return odds

    def simulated(self, drops: int, seed: int, engine: str, workers: Executor) -> Throws:
        """So many throws. Raises InputError: none of them came to rest."""
        throws = simulate(self.body, self.table, drops, seed, engine=engine, workers=workers)
        throws.require_rest()
        return throws

    def counts_on(
        self, tables: Sequence[Table], drops: int, seed: int, engine: str, workers: Executor
    ) -> list[Integers]:
        """As `counts`, of so many throws onto each of some tables, by their own seeds from the
        first on."""

        def counted(place: int) -> Integers:
            table = tables[place].lifted(self.table.size)
            return self.counts(simulate(self.body, table, drops, seed + place, engine=engine))

        # Engines are loaded by the first who asks for one, who is alone here.
        require_engine(engine)
        return list(workers.map(counted, range(len(tables))))

    def counts(self, throws: Throws) -> Integers:
        """(k + 1,) of the outcomes, and of throws that came to rest elsewhere."""
        by_outcome = self.outcomes.sums(throws.counts)
        return np.append(by_outcome, int(throws.counts.sum()) - int(by_outcome.sum()))


@dataclass(frozen=True, eq=False)
class ThrownDie:
    """What a finished die does on its table.

    Attributes
    ----------
    die: as it was thrown.
    momentum: (k,) odds of the outcomes by the momentum model.
    throws: the simulated ones, or None.
    """

    die: DieOnTable
    momentum: Floats
    throws: Throws | None

    def measured(self, target: Floats) -> SimulatedThrows | None:
        """The throws against a target (k,); None without throws."""
        throws = self.throws
        if throws is None:
            return None
        counts, resolved = self.die.counts(throws), throws.drops - throws.unresolved
        # None of the target is elsewhere.
        variation = measure_variation(counts, np.append(target, 0.0), CONFIDENCE)
        intervals = exact_intervals(counts[:-1], resolved, CONFIDENCE)
        return SimulatedThrows(
            engine=throws.engine,
            seed=throws.seed,
            drops=throws.drops,
            unresolved=throws.unresolved,
            counts=tuple(counts[:-1].tolist()),
            frequencies=tuple((counts[:-1] / resolved).tolist()),
            intervals=tuple((float(low), float(high)) for low, high in intervals),
            total_variation=variation.value,
            interval=(float(variation.interval[0]), float(variation.interval[1])),
            noise_floor=variation.noise_floor,
        )


@contextmanager
def throwing_threads() -> Iterator[Executor]:
    """Threads for throws; they suffice where an engine runs without Python's lock, as all but
    Bullet do."""
    workers = ThreadPoolExecutor(os.cpu_count())
    try:
        yield workers
    finally:
        # An interrupt does not wait for throws that have not begun.
        workers.shutdown(wait=True, cancel_futures=True)
