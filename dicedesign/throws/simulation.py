"""Throws of one body, and of a finished die onto its table, whatever engine ran them: where many
end, and a film of one."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

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
from dicedesign.runtime.workers import in_order
from dicedesign.throws.distances import measure_variation
from dicedesign.throws.engines import ENGINES, GRAVITY, advance, contact_of, require_engine
from dicedesign.throws.momentum_model import MomentumModel
from dicedesign.throws.momentum_probabilities import momentum_probabilities
from dicedesign.throws.rigid_body import (
    ORIENTATIONS,
    PAPER_DIRECTIONS,
    Orientations,
    RigidBody,
    drop_weights,
    release_states,
    rigid_body,
    vertical,
)
from dicedesign.throws.tables import Table, most_of
from dicedesign.tolerances import STANDING_ANGLE

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
    engine: str
    seed: int
    outcomes: Integers
    weights: Floats
    rests: int

    @property
    def drops(self) -> int:
        """Number of all."""
        return len(self.outcomes)

    @cached_property
    def counts(self) -> Integers:
        """(k,) drops that ended at each rest."""
        return np.bincount(self.outcomes[self.outcomes >= 0], minlength=self.rests)

    @cached_property
    def unresolved(self) -> int:
        """Drops that ended on an edge, stuck or still moving; they count for no rest."""
        return int((self.outcomes < 0).sum())

    def require_rest(self) -> None:
        """Raise InputError where no drop came to rest."""
        if self.unresolved == self.drops:
            raise InputError(
                f"table {self.table.name}: expected throws that come to rest, got none of "
                f"{self.drops}; raise its friction, or lower its restitution"
            )

    @cached_property
    def frequencies(self) -> Floats:
        """(k,) of the rests among the drops that were resolved, by weight; NaN if none was."""
        landed = self.outcomes >= 0
        weights = self.weights[landed]
        total = np.bincount(self.outcomes[landed], weights, minlength=self.rests)
        with np.errstate(invalid="ignore"):
            frequencies: Floats = total / weights.sum()
        return frequencies


def check_throws(drops: int, seed: int, engine: str, orientations: str) -> None:
    """Raise InputError for a number of drops or a seed that cannot be used, or an engine or kind of
    orientations that there is not."""
    check_whole("drops", drops)
    check_whole("seed", seed, least=0, most=MOST_SEED)
    # Raises where there is no such engine.
    ENGINES[engine]
    if orientations not in ORIENTATIONS:
        raise InputError(
            f"orientations: expected {', '.join(ORIENTATIONS)}, got {orientations!r}; take one of "
            "them"
        )
    if orientations == "icosahedron" and drops % PAPER_DIRECTIONS != 0:
        raise InputError(
            f"drops: expected a multiple of {PAPER_DIRECTIONS} with orientations icosahedron, "
            f"whose directions count only together, got {drops}; take "
            f"{PAPER_DIRECTIONS * max(1, round(drops / PAPER_DIRECTIONS))}"
        )


def simulate(
    body: RigidBody,
    table: Table,
    drops: int,
    seed: int = 0,
    *,
    engine: str = "native",
    orientations: Orientations = "uniform",
    refinement: float = 1.0,
    workers: Executor | None = None,
    progress: Callable[[int], None] | None = None,
) -> Throws:
    """Throw a body many times. No engine knows of the momentum-free model, except that a drop ends
    where that says it must.

    Parameters
    ----------
    drops: how many, above 0. seed: the same gives the same drops, in whatever number of workers.
    orientations: at which it is let go. refinement: divides the time step.
    workers: run tasks of `DROPS_PER_TASK` drops; None runs them here. A task whose worker is lost
        runs again.
    progress: called with the number of drops of each task that ended.

    Raises
    ------
    InputError: as `check_throws`, the engine is not installed, or a table without friction would
        let the die slide or spin for ever.
    DiceError: workers are lost again and again, or the executor cannot go on.
    """
    check_throws(drops, seed, engine, orientations)
    if table.friction == 0.0 and max(most_of(table.speed), most_of(table.spin)) > 0.0:
        raise InputError(
            f"table {table.name}: expected friction above 0 with a speed or a spin, which nothing "
            "would take from the die, got 0; raise it"
        )
    blocks = np.split(np.arange(drops), range(DROPS_PER_TASK, drops, DROPS_PER_TASK))
    tasks = [
        partial(throw_task, body, table, numbers, seed, engine, orientations, refinement)
        for numbers in blocks
    ]
    ended = (task() for task in tasks) if workers is None else in_order(tasks, workers)
    outcomes = []
    for outcome in ended:
        outcomes.append(outcome)
        if progress is not None:
            progress(len(outcome))
    return Throws(
        table,
        engine,
        seed,
        np.concatenate(outcomes),
        drop_weights(drops, orientations),
        len(body.rest_heights),
    )


def throw_task(
    body: RigidBody,
    table: Table,
    numbers: Integers,
    seed: int,
    engine: str,
    orientations: Orientations,
    refinement: float,
) -> Integers:
    """The rests (n,) of drops (n,), the first of which has a multiple of `DROPS_PER_TASK` as its
    number; -1 for those that found none."""
    count, rng = len(numbers), np.random.default_rng([seed, int(numbers[0]) // DROPS_PER_TASK])
    states = release_states(body, table, numbers, orientations, rng)
    outcomes = np.asarray(ENGINES[engine].throw_states(body, table, states, refinement))
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
    outcomes: OutcomeProbabilities
    table: Table

    @classmethod
    def of(
        cls, solid: Body, center_of_mass: Floats | None, directions: Floats, table: Table
    ) -> DieOnTable:
        """A solid with center of mass (3,), None for the uniform one, whose outcomes have
        directions (k, 3)."""
        poses = rest_poses(solid, center_of_mass)
        body = rigid_body(solid, poses)
        sized = table.for_size(2e-3 * body.radius)
        return cls(solid, body, poses, outcome_probabilities(poses, directions), sized)

    def momentum(self, model: MomentumModel | None) -> Floats:
        """(k,) probabilities of the outcomes by a momentum model; None for no momentum."""
        probabilities: Floats = self.outcomes.sums(
            momentum_probabilities(self.poses, self.body, model)
        )
        return probabilities

    def simulate(self, drops: int, seed: int, engine: str, workers: Executor) -> Throws:
        """Simulated throws. Raises InputError: none of them came to rest."""
        throws = simulate(self.body, self.table, drops, seed, engine=engine, workers=workers)
        throws.require_rest()
        return throws

    def counts_on(
        self, tables: Sequence[Table], drops: int, seed: int, engine: str, workers: Executor
    ) -> list[Integers]:
        """Counts of throws onto each of some tables, with consecutive seeds."""

        def counted(place: int) -> Integers:
            table = tables[place].for_size_above(self.table.size)
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
    """Probabilities of a finished die on its table.

    Attributes
    ----------
    die: as it was thrown.
    momentum: (k,) probabilities of the outcomes by the momentum model.
    throws: the simulated ones, or None.
    """

    die: DieOnTable
    momentum: Floats
    throws: Throws | None

    def measure(self, target: Floats) -> SimulatedThrows | None:
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
            intervals=tuple((low, high) for low, high in intervals.tolist()),
            total_variation=variation.value,
            interval=variation.interval,
            noise_floor=variation.noise_floor,
        )


@contextmanager
def throwing_threads() -> Iterator[Executor]:
    """Threads for throws; they suffice where an engine runs without Python's lock."""
    workers = ThreadPoolExecutor(os.cpu_count())
    try:
        yield workers
    finally:
        # An interrupt does not wait for throws that have not begun.
        workers.shutdown(wait=True, cancel_futures=True)


FRAMES_PER_SECOND: Final = 100
"""Of the motion, not of its display."""

CANDIDATES: Final = 25
"""Throws of which that of median length is filmed: neither one that stops at once nor a freak."""

SETTLED: Final = 0.02
"""Speed below which a die is at rest to the eye, in units of the square root of radius times
gravity: some 7 mm/s for a die of 25 mm."""


@dataclass(frozen=True)
class Film:
    """The poses of one thrown body.

    Attributes
    ----------
    body: what was thrown; table: onto what.
    seconds: (f,) since it was let go, 1 / `FRAMES_PER_SECOND` apart.
    positions: (f, 3) of the center of mass in m, the table being z = 0.
    quaternions: (f, 4) unit, w, x, y, z, from the principal axes to the world.
    rest: that it lies on in the end, in the order of `RestPoses`; -1 for a throw that was given up.
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

        points, center_of_mass: in the body's own frame and unit of length. They are scaled like the
        body, to the size of the table's die.
        """
        arms = (points - np.asarray(center_of_mass)) @ self.body.axes
        arms *= self.table.size / (2.0 * self.body.radius)
        return np.asarray(self.positions[frame] + arms @ self.rotations[frame].T)


def throw_film(body: RigidBody, table: Table, seed: int = 0, down: Floats | None = None) -> Film:
    """Film a typical throw, until the body is at rest to the eye.

    It is that of median length of `CANDIDATES` throws. A throw that has not come to rest in the
    time that simulations give it is given up there.

    seed: at least 0; the same gives the same film. down: (3,) unit direction of the body's own
    frame that is downward as it is let go; None for orientations at random.

    Raises InputError: the compiled kernels are missing.
    """
    contact = contact_of(table)
    rng = np.random.default_rng(seed)
    states = release_states(body, table, np.arange(CANDIDATES), "uniform", rng, down)
    _, steps = advance(body, table, states.copy(), round(contact.seconds / contact.step))
    state = states[[np.argsort(steps, kind="stable")[CANDIDATES // 2]]]
    # Whole steps to a frame.
    steps_per_frame = math.ceil(1.0 / (FRAMES_PER_SECOND * contact.step))
    refinement = steps_per_frame * FRAMES_PER_SECOND * contact.step
    # Engines stop where the end is certain, which is while the body still rocks.
    unstopped = replace(body, barriers=np.full_like(body.barriers, -np.inf))
    frames = [state[0].copy()]
    rest, radius = -1, table.size / 2.0
    while rest < 0 and len(frames) < contact.seconds * FRAMES_PER_SECOND:
        advance(unstopped, table, state, steps_per_frame, refinement)
        frames.append(state[0].copy())
        speeds = np.linalg.norm(state[0, 7:10]), radius * np.linalg.norm(state[0, 10:])
        if max(speeds) <= SETTLED * math.sqrt(GRAVITY * radius):
            angles = angle_between(body.rest_normals, -vertical(state[0, 3:7]))
            nearest = int(np.argmin(angles))
            rest = nearest if angles[nearest] <= STANDING_ANGLE else -1
    motion = np.array(frames)
    seconds = np.arange(len(motion)) / FRAMES_PER_SECOND
    return Film(body, table, seconds, motion[:, :3], motion[:, 3:7], rest)
