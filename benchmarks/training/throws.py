"""Simulated throws of random dice, and how near odds come to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from benchmarks.training.fitting import TrainingDie
from benchmarks.training.random_dice import RESTS, RandomDie, random_die
from dicedesign.runtime.arrays import Integers
from dicedesign.throws.distances import noise_floor, total_variation
from dicedesign.throws.momentum_model import MomentumModel, table_terms
from dicedesign.throws.momentum_odds import momentum_odds
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table
from dicedesign.throws.transition_features import Transitions, body_features


@dataclass(frozen=True)
class ThrownRandomDie:
    """A random die and where it came to rest on one table.

    Attributes
    ----------
    counts: (k,) how often each rest came up, in the order of its poses; at least one did.
    unresolved: drops that ended at none.
    """

    die: RandomDie
    table: Table
    counts: Integers
    unresolved: int


@dataclass(frozen=True)
class Deviation:
    """Total variation between a die's simulated frequencies and odds: those without momentum and
    those of the momentum model; noise_floor: the mean of right odds."""

    kind: str
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


def throw_random_die(
    number: int, seed: int, throws: Sequence[tuple[Table, int]], rests: tuple[int, int] = RESTS
) -> tuple[ThrownRandomDie, ...]:
    """Make a random die and throw it onto tables, so often onto each; the same, whoever does.

    number, seed, rests: as in `random_die`; no two dice of a seed share random numbers, but as many
    throws of one die onto several tables do. Raises InputError: no drop came to rest.
    """
    die, thrown = random_die(number, seed, rests), []
    for table, drops in throws:
        own = int(np.random.SeedSequence([seed, number, drops]).generate_state(1)[0])
        outcome = simulate(die.body, table, drops, own)
        outcome.require_rest()
        thrown.append(ThrownRandomDie(die, table, outcome.counts, outcome.unresolved))
    return tuple(thrown)


def training_dice(thrown: Sequence[ThrownRandomDie]) -> list[TrainingDie]:
    """One die that was thrown onto some tables, for the momentum model to be fitted to."""
    poses, body = thrown[0].die.poses, thrown[0].die.body
    side = poses.basins[0]
    hull, center = side.equilibria.hull, side.equilibria.center_of_mass
    transitions = Transitions.of(hull, side.paths)
    odds = side.areas / (4.0 * math.pi)
    features = body_features(transitions, hull.vertices, center, body.inertia, odds, np)
    dice = []
    for one in thrown:
        of_facet = np.zeros(len(hull.normals))
        of_facet[poses.facets] = one.counts / one.counts.sum()
        frequencies = of_facet[side.paths.rests]
        dice.append(TrainingDie(transitions, features, frequencies, table_terms(one.table)))
    return dice


def deviation(thrown: ThrownRandomDie, model: MomentumModel | None) -> Deviation:
    """Distances of the odds of a die from its throws; model: in NumPy."""
    # Dice are judged side by side, one on each core.
    torch.set_num_threads(1)
    die, drops = thrown.die, int(thrown.counts.sum())
    frequencies = thrown.counts / drops
    return Deviation(
        kind=die.kind,
        geometric=total_variation(frequencies, die.poses.probabilities),
        momentum=total_variation(frequencies, momentum_odds(die.poses, die.body, model)),
        noise_floor=noise_floor(frequencies, drops),
    )


def mean_deviations(deviations: Sequence[Deviation]) -> Deviations:
    """Means and worst of some dice."""
    geometric, momentum, floors = (
        [getattr(one, name) for one in deviations]
        for name in ("geometric", "momentum", "noise_floor")
    )
    return Deviations(
        dice=len(deviations),
        geometric=float(np.mean(geometric)),
        worst_geometric=max(geometric),
        momentum=float(np.mean(momentum)),
        worst_momentum=max(momentum),
        noise_floor=float(np.mean(floors)),
    )
