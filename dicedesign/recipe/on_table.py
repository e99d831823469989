"""The stages of a recipe that throw a die: to correct its design, and to judge it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.coordinates.symmetric import orbits_of_directions
from dicedesign.design.refinement import MOST_ROUNDS, Refinement, RefineOptions, Round
from dicedesign.design.result import DesignResult
from dicedesign.design.solvers.exact import ExactOptions
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.gradient.restitution_sensitivity import CHANGES, Swing
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.rest.outcomes import facet_of_rest, sums_by_outcome
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines.engine import Engine, require_engine
from dicedesign.throws.momentum.momentum_model import momentum_model
from dicedesign.throws.momentum.momentum_odds import momentum_odds
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.simulation.simulation import Throws, simulate
from dicedesign.throws.tables import Table, table_named

__all__ = [
    "DieOnTable",
    "TableVerdict",
    "check_throws_of",
    "first_swing",
    "judge_on_table",
    "refined",
]

SEEDS: Final = 1000
"""Seeds of throws between those of one recipe's seed and the next."""


def check_throws_of(options: ExactOptions, size_mm: float) -> None:
    """Raise InputError where a die cannot be thrown as the options say: there is no such table, it
    has no momentum model, the die is too large for it, or the engine is missing.

    size_mm: largest distance between two vertices of the die.
    """
    table = table_named(options.table)
    momentum_model(options.table)
    # The radius is at least half of that distance.
    replace(table, size=1e-3 * size_mm)
    if options.refine is not None:
        require_engine(options.refine.engine)


def first_swing(options: ExactOptions, wanted: Floats) -> Swing | None:
    """What the momentum model of the options' table knows of dice that are yet to be thrown, or
    None for dice set down.

    wanted: (k,) odds. Raises InputError: there is no such table, or it has no momentum model.
    """
    if options.odds != "thrown":
        return None
    thrown = ThrownOdds.on(options.table)
    return Swing(thrown, wanted, np.zeros((len(CHANGES), len(wanted))))


def refined(
    die: DesignResult,
    target: Floats,
    options: RefineOptions,
    table: str,
    *,
    size_mm: float,
    seed: int,
    group: Floats | None,
    center_of_mass: Floats | None,
    robust: bool,
    design: Callable[[DesignResult, Floats, Floats | None], DesignResult | None],
    on_round: Callable[[Round], None] | None,
) -> tuple[DesignResult, tuple[Round, ...]]:
    """A die corrected by simulated throws at its printed size; see `Refinement`."""
    orbits = (
        np.arange(len(target)) if group is None else orbits_of_directions(die.directions, group)
    )
    named, model = table_named(table), momentum_model(table)
    with _threads() as workers:

        def throw(
            tried: DesignResult, drops: int, number: int, change: float
        ) -> tuple[Integers, Floats]:
            scale = size_mm / tried.hull.diameter
            center = None if center_of_mass is None else scale * center_of_mass
            solid = make_body(scale * tried.hull.vertices, name="die")
            thrown = DieOnTable.of(solid, center, tried.directions, named.livelier(change))
            # Each change has a series of its own.
            own = SEEDS * seed + number + MOST_ROUNDS * [0.0, *CHANGES].index(change)
            throws = thrown.simulated(drops, own, options.engine, workers)
            there = None if model is None else model.at(change)
            odds = momentum_odds(thrown.poses, thrown.body, there)
            return thrown.counts(throws), thrown.by_outcome(odds)

        refinement = Refinement(
            target,
            orbits,
            options.drops,
            options.rounds,
            # Symmetry keeps equal odds equal on every table.
            robust and len(np.unique(orbits)) > 1,
            throw,
            design,
            on_round,
        )
        return refinement.refine(die)


@dataclass(frozen=True)
class TableVerdict:
    """What a finished die does on a table.

    Attributes
    ----------
    solid: the die in mm, as it was thrown; body: the same about its center of mass (3,).
    table: with the die's own size.
    momentum: (k,) odds of the outcomes by the momentum model.
    rounds: of the design.
    throws: the simulated ones, or None where the recipe asks for none.
    counts: (k + 1,) of the outcomes, and of throws that came to rest elsewhere; all 0 without
        throws.
    """

    solid: Body
    body: RigidBody
    center_of_mass: Floats
    table: Table
    momentum: Floats
    rounds: tuple[Round, ...]
    throws: Throws | None
    counts: Integers


def judge_on_table(
    solid: Body,
    center_of_mass: Floats | None,
    directions: Floats,
    options: ExactOptions,
    rounds: tuple[Round, ...],
    seed: int,
) -> TableVerdict:
    """Throws of a finished die, with random numbers that no round has used.

    solid: in mm; center_of_mass: (3,) given, or None for the uniform solid; directions: (k, 3)
    normals of the outcomes' facets.
    """
    thrown = DieOnTable.of(solid, center_of_mass, directions, table_named(options.table))
    model = momentum_odds(thrown.poses, thrown.body, momentum_model(options.table))
    throws, counts = None, np.zeros(len(directions) + 1, dtype=np.int64)
    if options.refine is not None:
        with _threads() as workers:
            throws = thrown.simulated(
                options.refine.verdict, SEEDS * seed + SEEDS - 1, options.refine.engine, workers
            )
        counts = thrown.counts(throws)
    return TableVerdict(
        solid,
        thrown.body,
        thrown.poses.center_of_mass,
        thrown.table,
        thrown.by_outcome(model),
        rounds,
        throws,
        counts,
    )


@dataclass(frozen=True)
class DieOnTable:
    """A body in mm, ready to be thrown.

    Attributes
    ----------
    poses: its rests. body: of the same. table: with the die's own size.
    outcome: (r,) of each rest, or -1.
    outcomes: how many there are.
    """

    poses: RestPoses
    body: RigidBody
    table: Table
    outcome: Integers
    outcomes: int

    @classmethod
    def of(
        cls, solid: Body, center_of_mass: Floats | None, directions: Floats, table: Table
    ) -> DieOnTable:
        poses = rest_poses(solid, center_of_mass)
        body = rigid_body(solid, poses)
        outcome = facet_of_rest(poses.normals, directions)
        return cls(poses, body, replace(table, size=2e-3 * body.radius), outcome, len(directions))

    def simulated(self, drops: int, seed: int, engine: Engine, workers: Executor) -> Throws:
        """So many throws. Raises InputError: none of them came to rest."""
        throws = simulate(self.body, self.table, drops, seed, engine=engine, workers=workers)
        if throws.unresolved == drops:
            raise InputError(
                f"table {self.table.name}: expected throws that come to rest, got none of {drops}; "
                "raise its friction, or lower its restitution"
            )
        return throws

    def counts(self, throws: Throws) -> Integers:
        """(k + 1,) of the outcomes, and of throws that came to rest elsewhere."""
        found = self.by_outcome(throws.counts)
        return np.append(found, int(throws.counts.sum()) - int(found.sum()))

    def by_outcome(self, of_rests: NDArray[Any]) -> NDArray[Any]:
        """Sums (k,) over the rests of each outcome."""
        return sums_by_outcome(of_rests, self.outcome, self.outcomes)


@contextmanager
def _threads() -> Iterator[Executor]:
    """Threads suffice where an engine runs without Python's lock, as all but Bullet do."""
    workers = ThreadPoolExecutor(os.cpu_count())
    try:
        yield workers
    finally:
        # An interrupt does not wait for throws that have not begun.
        workers.shutdown(wait=True, cancel_futures=True)
