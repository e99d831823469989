"""Dice thrown by several simulators, and by the package's own with other steps and contacts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np
from scipy.sparse.csgraph import connected_components

from benchmarks.training.random_dice import DICE_KINDS, random_die
from dicedesign.bench.measures.recipes import begun, designed
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.recipe.schema.reading import read_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Integers
from dicedesign.runtime.workers import in_order
from dicedesign.throws import bullet_engine, mujoco_engine, native
from dicedesign.throws.engines import ThrowStates
from dicedesign.throws.release import released
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.tables import Table
from dicedesign.throws.two_samples import SampledVariation, sampled_variation

__all__ = [
    "PAIRS",
    "WAYS",
    "NamedDie",
    "ThrownWays",
    "Way",
    "given_die",
    "random_dice",
    "throw_in_ways",
]

SEED: Final = 2_000_000
"""Of random dice and of all throws; not one that models are fitted with."""

DROPS_PER_TASK: Final = 500

ALIKE: Final = math.radians(3.0)
"""Angle between normals of rests that are counted as one."""


@dataclass(frozen=True)
class Way:
    """A way to simulate throws: its name, the engine that it needs, and what throws."""

    name: str
    engine: str
    throw: ThrowStates


WAYS: Final = (
    Way("native", "native", native.throw_states),
    Way("native again", "native", native.throw_states),
    Way("half the step", "native", partial(native.throw_states, refinement=2.0)),
    Way("a quarter of it", "native", partial(native.throw_states, refinement=4.0)),
    Way("half as stiff", "native", partial(native.throw_states, stiffness=0.5)),
    Way("twice as stiff", "native", partial(native.throw_states, stiffness=2.0)),
    Way("MuJoCo", "mujoco", mujoco_engine.throw_states),
    Way("Bullet", "bullet", bullet_engine.throw_states),
)
"""The first is held against all others; the second is the same with other random numbers."""

PAIRS: Final = (*((WAYS[0].name, way.name) for way in WAYS[1:]), ("MuJoCo", "Bullet"))
"""Names of those that are compared."""


@dataclass(frozen=True)
class NamedDie:
    """A die to throw, and how it is called."""

    name: str
    body: RigidBody

    @cached_property
    def outcome_of_rest(self) -> Integers:
        """(k,) from 0 on, the same for rests within `ALIKE` of each other, as on the two triangles
        of a face that is not quite plane: which of them a die lies on nobody can see."""
        normals = self.body.rest_normals
        close = normals @ normals.T > math.cos(ALIKE)
        _, outcomes = connected_components(close)
        return np.asarray(outcomes, dtype=np.int64)


@dataclass(frozen=True)
class ThrownWays:
    """A die's throws.

    Attributes
    ----------
    name: of the die.
    counts: (g + 1,) of its outcomes and of drops that came to none, by the name of the way.
    """

    name: str
    counts: dict[str, Integers]

    def variation(self, first: str, second: str) -> SampledVariation:
        """Between the frequencies of the outcomes in two ways."""
        return sampled_variation(self.counts[first][:-1], self.counts[second][:-1])


def given_die(path: Path) -> NamedDie:
    """The die of a recipe, as designed, or of a mesh.

    Raises
    ------
    InputError: the file cannot be read.
    DiceError: the recipe leads to no die.
    """
    if path.suffix not in (".yaml", ".yml"):
        body = read_body(path)
        return NamedDie(path.name, rigid_body(body, rest_poses(body)))
    recipe = read_recipe(path)
    work = begun(recipe)
    designed(work)
    body = make_body(work.die.hull.vertices, name=recipe.name)
    return NamedDie(recipe.name, rigid_body(body, rest_poses(body, work.die.center_of_mass)))


def random_dice(count: int) -> Iterator[NamedDie]:
    """So many random dice, of all kinds in turn."""
    taken, number = Counter[str](), 0
    while taken.total() < count:
        die = random_die(number, SEED)
        if taken[die.kind] <= taken.total() // len(DICE_KINDS):
            taken[die.kind] += 1
            yield NamedDie(f"{die.kind} {number}", die.body)
        number += 1


def throw_in_ways(
    dice: Sequence[NamedDie],
    ways: Sequence[Way],
    drops: Mapping[str, int],
    table: Table,
    workers: Executor,
) -> Iterator[ThrownWays]:
    """Each die thrown in each way, with random numbers of its own; drops: by the way's engine."""
    names = [way.name for way in WAYS]
    parts = [
        (number, way, first)
        for number in range(len(dice))
        for way in ways
        for first in range(0, drops[way.engine], DROPS_PER_TASK)
    ]
    tasks = [
        partial(
            throw_part,
            dice[number],
            table,
            way,
            min(DROPS_PER_TASK, drops[way.engine] - first),
            (SEED, number, names.index(way.name), first),
        )
        for number, way, first in parts
    ]
    counted = zip(parts, in_order(tasks, workers), strict=True)
    for number, of_die in groupby(counted, key=lambda one: one[0][0]):
        counts = {way.name: np.zeros(1, dtype=np.int64) for way in ways}
        for (_, way, _), came in of_die:
            counts[way.name] = counts[way.name] + came
        yield ThrownWays(dice[number].name, counts)


def throw_part(die: NamedDie, table: Table, way: Way, drops: int, seed: Sequence[int]) -> Integers:
    """Counts (g + 1,) of the outcomes, and of drops that came to none."""
    rng = np.random.default_rng(seed)
    states = released(die.body, table, np.arange(drops), "uniform", rng)
    rests = way.throw(die.body, table, states)
    outcome_of_rest = np.append(die.outcome_of_rest, die.outcome_of_rest.max() + 1)
    return np.bincount(outcome_of_rest[rests], minlength=int(outcome_of_rest[-1]) + 1)
