"""Simulated throws of one body, throws of a finished die onto its table, and films of a throw."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from dicedesign.errors import MOST_SEED, InputError, check_whole
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_probabilities
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.results.parts import SimulatedThrows
from dicedesign.runtime.arrays import Floats, Integers, exact_intervals
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.throws.distances import measure_variation
from dicedesign.throws.engines import ENGINES, advance, longest_throw, time_step
from dicedesign.throws.momentum_model import MomentumMixture
from dicedesign.throws.momentum_probabilities import momentum_probabilities
from dicedesign.throws.rigid_body import (
    RigidBody,
    release_states,
    rigid_body,
    vertical,
)
from dicedesign.throws.tables import GRAVITY, Table, load_table, mixture_tables, most_of
from dicedesign.tolerances import STANDING_ANGLE

DROPS_PER_TASK = 500
"""Drops that share a random generator, so that results do not depend on the workers."""


@dataclass(frozen=True)
class Throws:
    """Simulated throws of one body.

    Attributes
    ----------
    tables: t tables, onto which drops fall in turn: drop i onto table i modulo t.
    engine: name of the simulator; seed: of its random numbers.
    outcomes: (n,) final rest of each drop, in the order of `RestPoses`; -1 for drops that ended on
        no facet in time.
    rests: number of rests of the body.
    """

    tables: tuple[Table, ...]
    engine: str
    seed: int
    outcomes: Integers
    rests: int

    @property
    def drops(self) -> int:
        """Number of drops."""
        return len(self.outcomes)

    @cached_property
    def counts(self) -> Integers:
        """(k,) numbers of drops that ended at each rest."""
        return self.counts_by_table.sum(axis=0)

    @cached_property
    def counts_by_table(self) -> Integers:
        """(t, k) numbers of drops onto each table that ended at each rest."""
        landed = self.outcomes >= 0
        table = np.arange(self.drops)[landed] % len(self.tables)
        counts = np.zeros((len(self.tables), self.rests), dtype=np.int64)
        np.add.at(counts, (table, self.outcomes[landed]), 1)
        return counts

    @cached_property
    def unresolved(self) -> int:
        """Number of drops that ended on an edge, stuck or still moving; they count for no rest."""
        return int((self.outcomes < 0).sum())

    def require_rest(self) -> None:
        """Raise InputError if no drop came to rest."""
        if self.unresolved == self.drops:
            raise InputError(
                f"table {self.tables[0].name}: expected throws that come to rest, got none of "
                f"{self.drops}; raise its friction, or lower its restitution"
            )

    @cached_property
    def frequencies(self) -> Floats:
        """(k,) frequencies of the rests among resolved drops; NaN if there are none."""
        with np.errstate(invalid="ignore"):
            frequencies: Floats = self.counts / self.counts.sum()
        return frequencies


def check_throws(drops: int, seed: int, engine: str) -> None:
    """Raise InputError for an invalid number of drops or seed, or an unknown engine."""
    check_whole("drops", drops)
    check_whole("seed", seed, least=0, most=MOST_SEED)
    # Raises for an unknown engine.
    ENGINES[engine]


def simulate(
    body: RigidBody,
    table: Table | Sequence[Table],
    drops: int,
    seed: int = 0,
    *,
    engine: str = "native",
    workers: Executor | None = None,
    checkpoint: Checkpoint | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> Throws:
    """Simulate throws of a body.

    Parameters
    ----------
    table: one table, or several, such as `mixture_tables`, onto which drops fall in turn.
    drops: number of throws, above 0. seed: determines the drops, for any number of workers.
    workers: run tasks of `DROPS_PER_TASK` drops; None runs them in this thread. A task whose worker
        is lost runs again.
    checkpoint: finished tasks are read from it, new ones are added.
    progress: called with the number of drops of each finished task.

    Raises
    ------
    InputError: as `check_throws`, the engine is not installed, or the table has no friction but the
        throws have a speed or a spin.
    DiceError: workers are lost repeatedly, or the executor fails.
    """
    check_throws(drops, seed, engine)
    tables = (table,) if isinstance(table, Table) else tuple(table)
    for one in tables:
        if one.friction == 0.0 and max(most_of(one.speed), most_of(one.spin)) > 0.0:
            raise InputError(
                f"table {one.name}: expected friction above 0 with a speed or a spin, which "
                "nothing would take from the die, got 0; raise it"
            )
    blocks = np.split(np.arange(drops), range(DROPS_PER_TASK, drops, DROPS_PER_TASK))
    tasks = [partial(throw_task, body, tables, numbers, seed, engine) for numbers in blocks]
    series = body.digest(tables, drops, seed, engine)
    outcomes = (checkpoint or Checkpoint()).results(
        series, tasks, workers, lambda outcome: progress(len(outcome))
    )
    return Throws(tables, engine, seed, np.concatenate(outcomes), len(body.rest_heights))


def throw_task(
    body: RigidBody, tables: Sequence[Table], numbers: Integers, seed: int, engine: str
) -> Integers:
    """Rests (n,) of drops with consecutive numbers (n,), from a multiple of `DROPS_PER_TASK` on; -1
    without a rest."""
    rng = np.random.default_rng([seed, int(numbers[0]) // DROPS_PER_TASK])
    came = np.empty(len(numbers), dtype=np.int64)
    for place, table in enumerate(tables):
        onto = numbers % len(tables) == place
        if onto.any():
            states = release_states(body, table, int(onto.sum()), rng)
            came[onto] = _rests_by(engine, body, table, states)
    return came


def _rests_by(engine: str, body: RigidBody, table: Table, states: Floats) -> Integers:
    """Rests (n,) of bodies released in states (n, 13), by an engine. Raises InputError if it gives
    anything else."""
    count, outcomes = len(states), np.asarray(ENGINES[engine].throw_states(body, table, states))
    rests = len(body.rest_heights)
    if outcomes.shape != (count,) or outcomes.dtype.kind != "i":
        raise InputError(
            f"engine {engine!r}: expected whole numbers of shape ({count},), a rest for each "
            f"throw, got {outcomes.dtype} of shape {outcomes.shape}; correct it"
        )
    if not ((outcomes >= -1) & (outcomes < rests)).all():
        raise InputError(
            f"engine {engine!r}: expected rests from -1, for none, to {rests - 1}, got "
            f"{outcomes.min()} to {outcomes.max()}; correct it"
        )
    return outcomes


CONFIDENCE = 0.95
"""Confidence of all intervals."""


@dataclass(frozen=True, eq=False)
class DieOnTable:
    """Die in mm on its table.

    Attributes
    ----------
    solid: the die; body: the die as a rigid body.
    poses: its rests; outcomes: their outcomes.
    table: with the die's own size; tables: those of its mixture, alike.
    """

    solid: Body
    body: RigidBody
    poses: RestPoses
    outcomes: OutcomeProbabilities
    table: Table
    tables: tuple[Table, ...]

    @classmethod
    def of(
        cls,
        solid: Body,
        center_of_mass: Floats | None,
        directions: Floats,
        table: str,
        outcome_of: Integers | None = None,
    ) -> DieOnTable:
        """Die from a solid with center of mass (3,), or None for the uniform solid's, and faces of
        directions (f, 3). table: its name; outcome_of: (f,) outcome that each shows; None for one
        outcome each."""
        poses = rest_poses(solid, center_of_mass)
        body = rigid_body(solid, poses)
        size = 2e-3 * body.radius
        tables = tuple(one.for_size_above(size) for one in mixture_tables(table))
        outcomes = outcome_probabilities(poses, directions, outcome_of)
        return cls(solid, body, poses, outcomes, load_table(table).for_size(size), tables)

    def momentum(self, mixture: MomentumMixture | None) -> Floats:
        """(k,) probabilities of the outcomes by a momentum model; None is without momentum."""
        probabilities: Floats = self.outcomes.sums(
            momentum_probabilities(self.poses, self.body, mixture)
        )
        return probabilities

    def momentum_by_table(self, mixture: MomentumMixture | None) -> Floats:
        """(t, k) probabilities of the outcomes on each table of the mixture."""
        near = [None if mixture is None else mixture.near(table) for table in self.tables]
        return np.array([self.momentum(one) for one in near])

    def simulate(self, drops: int, seed: int, **options: Any) -> Throws:
        """Simulate throws onto the tables of the mixture in turn, with options of `simulate`.
        Raises InputError if none of them came to rest."""
        throws = simulate(self.body, self.tables, drops, seed, **options)
        throws.require_rest()
        return throws

    def counts(self, throws: Throws) -> Integers:
        """Counts (t, k + 1) of the outcomes on each table, and of throws that came to rest
        elsewhere."""
        by_table = throws.counts_by_table
        by_outcome = np.array([self.outcomes.sums(counts) for counts in by_table])
        return np.column_stack([by_outcome, by_table.sum(axis=1) - by_outcome.sum(axis=1)])


@dataclass(frozen=True, eq=False)
class ThrownDie:
    """Probabilities of a finished die on its table.

    Attributes
    ----------
    die: the die on its table.
    momentum: (k,) probabilities of the outcomes by the momentum model.
    throws: simulated throws, or None.
    """

    die: DieOnTable
    momentum: Floats
    throws: Throws | None

    def measure(self, target: Floats) -> SimulatedThrows | None:
        """Comparison of the throws with a target (k,); None without throws."""
        throws = self.throws
        if throws is None:
            return None
        counts = self.die.counts(throws).sum(axis=0)
        resolved = throws.drops - throws.unresolved
        variation = measure_variation(counts, np.append(target, 0.0), CONFIDENCE)
        intervals = exact_intervals(counts[:-1], resolved, CONFIDENCE)
        return SimulatedThrows(
            engine=throws.engine,
            seed=throws.seed,
            drops=throws.drops,
            unresolved=throws.unresolved,
            counts=tuple(counts[:-1].tolist()),
            frequencies=tuple((counts[:-1] / resolved).tolist()),
            intervals=tuple((low, high) for low, high in intervals.tolist()),
            total_variation=variation.value,
            interval=variation.interval,
            noise_floor=variation.noise_floor,
        )


@contextmanager
def throwing_threads() -> Iterator[Executor]:
    """Thread pool for throws; the native engine runs without Python's lock."""
    workers = ThreadPoolExecutor(os.cpu_count())
    try:
        yield workers
    finally:
        # An interrupt cancels throws that have not begun.
        workers.shutdown(wait=True, cancel_futures=True)


FRAMES_PER_SECOND = 100
"""Frames per second of the motion, not of its display."""

CANDIDATES = 25
"""Throws of which the one of median length is filmed."""

SETTLED = 0.02
"""Speed below which a die looks at rest, in units of the square root of radius times gravity: about
7 mm/s for a die of 25 mm."""


@dataclass(frozen=True)
class Film:
    """Film of one thrown body.

    Attributes
    ----------
    body: the thrown body; table: parameters of the throw.
    seconds: (f,) since the release, 1 / `FRAMES_PER_SECOND` apart.
    positions: (f, 3) of the center of mass in m, with the table at z = 0.
    quaternions: (f, 4) unit, w, x, y, z, from the principal axes to the world.
    rest: final rest, in the order of `RestPoses`; -1 for a throw that was given up.
    """

    body: RigidBody
    table: Table
    seconds: Floats
    positions: Floats
    quaternions: Floats
    rest: int

    @cached_property
    def rotations(self) -> Floats:
        """(f, 3, 3) matrices of the quaternions."""
        return np.asarray(Rotation.from_quat(self.quaternions, scalar_first=True).as_matrix())

    def place_points(self, points: Floats, center_of_mass: ArrayLike, frame: int) -> Floats:
        """Positions (n, 3) in m of points (n, 3) of the body in a frame.

        points, center_of_mass: in the body's own frame and unit of length; scaled to the size of
        the table's die.
        """
        arms = (points - np.asarray(center_of_mass)) @ self.body.axes
        arms *= self.table.size / (2.0 * self.body.radius)
        return np.asarray(self.positions[frame] + arms @ self.rotations[frame].T)


def throw_film(
    body: RigidBody,
    table: Table,
    seed: int = 0,
    down: Floats | None = None,
    candidates: int = CANDIDATES,
) -> Film:
    """Film a throw until the body looks at rest or the time of simulations is up.

    seed: at least 0, determines the film. down: (3,) unit direction of the body's own frame that
    points down at release; None for random orientations. candidates: number of throws, of which the
    one of median length is filmed; 1 for a throw without selection.

    Raises InputError if the compiled kernels are missing.
    """
    step, seconds = time_step(table), longest_throw(table)
    rng = np.random.default_rng(seed)
    states = release_states(body, table, candidates, rng, down)
    _, steps = advance(body, table, states.copy(), round(seconds / step))
    state = states[[np.argsort(steps, kind="stable")[candidates // 2]]]
    # A whole number of steps in a frame.
    steps_per_frame = math.ceil(1.0 / (FRAMES_PER_SECOND * step))
    refinement = steps_per_frame * FRAMES_PER_SECOND * step
    # Without barriers, the simulation goes on while the body still rocks.
    unstopped = replace(
        body, barriers=np.full_like(body.barriers, -np.inf), flat=body.flat * [1.0, -1.0, 1.0]
    )
    frames = [state[0].copy()]
    rest, radius = -1, table.size / 2.0
    while rest < 0 and len(frames) < seconds * FRAMES_PER_SECOND:
        advance(unstopped, table, state, steps_per_frame, refinement)
        frames.append(state[0].copy())
        speeds = np.linalg.norm(state[0, 7:10]), radius * np.linalg.norm(state[0, 10:])
        if max(speeds) <= SETTLED * math.sqrt(GRAVITY * radius):
            angles = angle_between(body.rest_normals, -vertical(state[0, 3:7]))
            nearest = int(np.argmin(angles))
            rest = nearest if angles[nearest] <= STANDING_ANGLE else -1
    motion = np.array(frames)
    times = np.arange(len(motion)) / FRAMES_PER_SECOND
    return Film(body, table, times, motion[:, :3], motion[:, 3:7], rest)
