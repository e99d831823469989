"""Simulated throws of random dice, and how near odds come to them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest

import numpy as np
import torch

from benchmarks.training.momentum_training import TrainingDie
from benchmarks.training.random_dice import RESTS, RandomDie, random_die
from dicedesign.runtime.arrays import Integers
from dicedesign.runtime.workers import in_order
from dicedesign.throws.distances import noise_floor, total_variation
from dicedesign.throws.momentum_model import MomentumModel
from dicedesign.throws.momentum_odds import momentum_odds
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_terms import table_terms
from dicedesign.throws.tables import Table
from dicedesign.throws.transition_features import Transitions, body_features

__all__ = [
    "Deviation",
    "Deviations",
    "ThrownRandomDie",
    "deviation",
    "flat_counts",
    "mean_deviations",
    "throw_random_dice",
    "throw_random_die",
    "training_dice",
]


@dataclass(frozen=True)
class ThrownRandomDie:
    """A random die and where it came to rest.

    Attributes
    ----------
    number: of the die. die: itself.
    counts: (k,) how often each rest came up, in the order of its poses; at least one did.
    unresolved: drops that ended at none.
    """

    number: int
    die: RandomDie
    counts: Integers
    unresolved: int


@dataclass(frozen=True)
class Deviation:
    """Total variation between a die's simulated frequencies and odds.

    Attributes
    ----------
    kind: of die. rests: how many. drops: that came to rest.
    geometric, momentum: for the odds without momentum, and those of the momentum model.
    noise_floor: mean of that of right odds.
    """

    kind: str
    rests: int
    drops: int
    geometric: float
    momentum: float
    noise_floor: float


@dataclass(frozen=True)
class Deviations:
    """Means over some dice, at least one, and the worst of them; as in `Deviation`."""

    dice: int
    geometric: float
    worst_geometric: float
    momentum: float
    worst_momentum: float
    noise_floor: float


def throw_random_dice(
    throws: Sequence[Sequence[tuple[Table, int]]],
    seed: int,
    workers: Executor,
    *,
    known: Sequence[Integers] = (),
    rests: tuple[int, int] = RESTS,
    engine: str = "native",
) -> Iterator[tuple[ThrownRandomDie, ...]]:
    """`throw_random_die` of the numbers from 0 on, in order.

    throws: of each die; known: of the first dice.
    """
    tasks = [
        partial(throw_random_die, number, seed, of_die, rests, engine, came)
        for number, (of_die, came) in enumerate(zip_longest(throws, known))
    ]
    return in_order(tasks, workers)


def throw_random_die(
    number: int,
    seed: int,
    throws: Sequence[tuple[Table, int]],
    rests: tuple[int, int] = RESTS,
    engine: str = "native",
    known: Integers | None = None,
) -> tuple[ThrownRandomDie, ...]:
    """Make a random die and throw it; the same, whoever does.

    number, seed, rests: as in `random_die`; no two dice of a seed share random numbers, but as many
    throws of one die onto several tables do. throws: tables, and how often it is thrown onto each.
    known: `flat_counts` of these throws, which are then not simulated again.

    Raises InputError: no drop came to rest, or as `simulate`.
    """
    # Dice are made side by side, one on each core.
    torch.set_num_threads(1)
    die, thrown = random_die(number, seed, rests), []
    if known is not None:
        rows = known.reshape(len(throws), -1)
        return tuple(ThrownRandomDie(number, die, row[1:], int(row[0])) for row in rows)
    for table, drops in throws:
        own = int(np.random.SeedSequence([seed, number, drops]).generate_state(1)[0])
        outcome = simulate(die.body, table, drops, own, engine=engine)
        outcome.require_rest()
        thrown.append(ThrownRandomDie(number, die, outcome.counts, outcome.unresolved))
    return tuple(thrown)


def flat_counts(thrown: Sequence[ThrownRandomDie]) -> Integers:
    """(t (1 + k),) unresolved drops and counts of one die that was thrown onto t tables."""
    return np.concatenate([[one.unresolved, *one.counts] for one in thrown]).astype(np.int64)


def training_dice(thrown: Sequence[ThrownRandomDie], tables: Sequence[Table]) -> list[TrainingDie]:
    """One die that was thrown onto some tables, for the momentum model to be fitted to."""
    poses, body = thrown[0].die.poses, thrown[0].die.body
    side = poses.basins[0]
    hull, center = side.equilibria.hull, side.equilibria.center_of_mass
    transitions = Transitions.of(hull, side.paths)
    odds = side.areas / (4.0 * math.pi)
    features = body_features(transitions, hull.vertices, center, body.inertia, odds, np)
    dice = []
    for one, table in zip(thrown, tables, strict=True):
        of_facet = np.zeros(len(hull.normals))
        of_facet[poses.facets] = one.counts / one.counts.sum()
        frequencies = of_facet[side.paths.rests]
        dice.append(TrainingDie(transitions, features, frequencies, table_terms(table)))
    return dice


def deviation(thrown: ThrownRandomDie, model: MomentumModel | None) -> Deviation:
    """Distances of the odds of a die from its throws; model: in NumPy."""
    die, drops = thrown.die, int(thrown.counts.sum())
    frequencies = thrown.counts / drops
    return Deviation(
        kind=die.kind,
        rests=len(frequencies),
        drops=drops,
        geometric=total_variation(frequencies, die.poses.probabilities),
        momentum=total_variation(frequencies, momentum_odds(die.poses, die.body, model)),
        noise_floor=noise_floor(frequencies, drops),
    )


def mean_deviations(deviations: Sequence[Deviation]) -> Deviations:
    """Means and worst of some dice."""
    geometric, momentum = (
        [getattr(d, name) for d in deviations] for name in ("geometric", "momentum")
    )
    return Deviations(
        dice=len(deviations),
        geometric=float(np.mean(geometric)),
        worst_geometric=max(geometric),
        momentum=float(np.mean(momentum)),
        worst_momentum=max(momentum),
        noise_floor=float(np.mean([d.noise_floor for d in deviations])),
    )
