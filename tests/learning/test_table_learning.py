"""The momentum model learned from throws: of real ones, and of a world that it knows exactly."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from common.inline_executor import Inline
from common.kernels import compiled_only

from dicedesign.errors import InputError
from dicedesign.learning import momentum_training, random_throws
from dicedesign.learning.random_dice import random_die
from dicedesign.learning.random_throws import (
    ThrownRandomDie,
    deviation,
    mean_deviations,
    throw_random_dice,
    throw_random_die,
    training_dice,
)
from dicedesign.learning.table_learning import learn_momentum, throws_of_die
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.executors import local_workers
from dicedesign.runtime.kept_file import KeptFile
from dicedesign.throws.momentum.general_model import GeneralModel, general_model_of
from dicedesign.throws.momentum.momentum_model import MomentumModel
from dicedesign.throws.momentum.momentum_odds import landing_odds, momentum_odds
from dicedesign.throws.momentum.network import Network
from dicedesign.throws.momentum.table_terms import GENERAL, TABLE_TERMS
from dicedesign.throws.momentum.transition_features import CARRY_FEATURES, TRANSITION_FEATURES
from dicedesign.throws.release import drop_weights
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation.simulation import Throws
from dicedesign.throws.tables import Table, table_named

TABLE = table_named("board-game")


def network(features: int, outputs: int, bias: float) -> Network:
    """One that gives the same for all but its first feature, on whose size the rate depends, and
    more on livelier tables."""
    linear, biases = np.zeros((features, outputs)), np.zeros((TABLE_TERMS, outputs))
    linear[0, 0] = -0.5
    biases[:2, 0] = bias, 0.6
    return Network(
        np.full(features, 0.1),
        np.ones(features),
        linear,
        biases,
        np.zeros((features, 1)),
        np.zeros((TABLE_TERMS, 1)),
        np.zeros((1, outputs)),
    )


NUMBERS = np.zeros((TABLE_TERMS, 3))
NUMBERS[:2] = [(np.log(0.12), 2.0, 1.0), (0.2, 0.0, 0.0)]

TRUTH = GeneralModel(
    GENERAL,
    NUMBERS,
    network(len(TRANSITION_FEATURES), 4, -0.6),
    network(len(CARRY_FEATURES), 3, -2.0),
)

NEAR = MomentumModel.of(TRUTH, TABLE)


@pytest.fixture
def known_world(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dice fall as `TRUTH` says, without chance."""
    makers = {}

    def make(number: int, seed: int, rests: tuple[int, int]) -> object:
        die = random_die(number, seed, rests)
        makers[die.body.name] = die.poses
        return die

    def throw(body: RigidBody, table: Table, drops: int, seed: int, *, engine: str) -> Throws:
        odds = momentum_odds(makers[body.name], body, MomentumModel.of(TRUTH, table))
        ends = np.round(np.cumsum(odds) * drops).astype(np.int64)
        outcomes = np.repeat(np.arange(len(odds)), np.diff(ends, prepend=0))
        return Throws(table, engine, seed, outcomes, drop_weights(drops, "uniform"), len(odds))

    monkeypatch.setattr(random_throws, "random_die", make)
    monkeypatch.setattr(random_throws, "simulate", throw)


def test_a_world_that_is_the_model_is_learned(known_world: None) -> None:
    """From what the package knows of another world."""
    dice: list[int] = []
    losses: list[float] = []
    found = learn_momentum(
        (TABLE,),
        False,
        40,
        100_000,
        0,
        25,
        workers=Inline(),
        on_die=dice.append,
        on_epoch=losses.append,
    )
    assert dice == 40 * [1]
    assert len(losses) == 25
    assert losses[-1] < 0.3 * losses[0]
    assert (found.fitted.dice, found.held_out.dice, found.unresolved) == (36, 4, 0)
    assert found.held_out.geometric > 0.08
    assert found.fitted.momentum < 0.25 * found.fitted.geometric
    assert found.held_out.momentum < 0.35 * found.held_out.geometric


def test_all_tables_are_learned_from_nothing(known_world: None) -> None:
    found = learn_momentum((TABLE,), True, 40, 100_000, 0, 25, workers=Inline())
    assert found.held_out.momentum < 0.35 * found.held_out.geometric
    model = general_model_of(found.plain)
    np.testing.assert_allclose(model.range.most, GENERAL.most)
    far = table_named("hard-wood")
    for number in range(3):
        die = random_die(number, 7)
        learned, true = (
            momentum_odds(die.poses, die.body, MomentumModel.of(of, far)) for of in (model, TRUTH)
        )
        assert np.abs(learned - true).sum() < 0.5 * np.abs(die.poses.probabilities - true).sum()


def test_learning_that_is_killed_goes_on_and_does_nothing_twice(
    known_world: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed again and again: after dice, after evaluations, and when all was done."""
    monkeypatch.setattr(KeptFile, "is_due", True)
    monkeypatch.setattr(random_throws, "random_die", cache(random_throws.random_die))
    simulated, evaluated = Calls(random_throws.simulate), Calls(momentum_training.landing_odds)
    monkeypatch.setattr(random_throws, "simulate", simulated)
    monkeypatch.setattr(momentum_training, "landing_odds", evaluated)

    def learned(checkpoint: Checkpoint, stop: int | None = None) -> tuple[object, int]:
        numbers = count(1)

        def told(_: object) -> None:
            if next(numbers) == stop:
                raise Killed

        found = learn_momentum(
            (TABLE,),
            False,
            10,
            1000,
            0,
            6,
            workers=Inline(),
            checkpoint=checkpoint,
            on_die=told,
            on_epoch=told,
        )
        return found, next(numbers) - 1

    whole, calls = learned(Checkpoint())
    assert calls == 10 + 6
    evaluations, evaluated.count = evaluated.count, 0
    for stop in (1, 6, 10, 11, 14, calls):
        if stop == 11:
            simulated.count = 0
        with pytest.raises(Killed):
            learned(Checkpoint(tmp_path / "c.npz", {"seed": "0"}), stop)
    assert learned(Checkpoint(tmp_path / "c.npz", {"seed": "0"})) == (whole, calls)
    assert (simulated.count, evaluated.count) == (0, evaluations)


class Killed(BaseException):
    """Nothing that anybody takes care of."""


class Calls:
    """A function, and how often it was called."""

    def __init__(self, function: Callable[..., object]) -> None:
        self.function = function
        self.count = 0

    def __call__(self, *arguments: object, **options: object) -> object:
        self.count += 1
        return self.function(*arguments, **options)


def test_rows_of_other_dice_are_refused(known_world: None, tmp_path: Path) -> None:
    for kind, length in (("throws", 6), ("throws", 7), ("epochs", 3)):
        kept = Checkpoint()
        kept.add(kind, [np.zeros(length, dtype=np.int64)])
        with pytest.raises(InputError, match="expected a checkpoint of this work"):
            learn_momentum((TABLE,), False, 10, 30, 0, 1, workers=Inline(), checkpoint=kept)


@compiled_only
def test_the_same_numbers_give_the_same_model_on_two_processes() -> None:
    def learned(workers: Executor) -> object:
        return learn_momentum((TABLE,), False, 10, 40, 1, 2, workers=workers)

    with local_workers(2) as workers:
        assert learned(workers) == learned(Inline())


def test_every_tenth_die_is_held_out_and_thrown_more() -> None:
    farthest = []
    for number in range(21):
        near, far = (throws_of_die((TABLE,), general, number, 10, 0) for general in (False, True))
        if number % 10 == 9:
            assert near == far == [(TABLE, 40)]
            continue
        for onto in (near, far):
            assert [drops for _, drops in onto] == [3, 3, 3, 3]
            assert onto[0][0] == TABLE
            assert len({table.restitution for table, _ in onto}) == 4
        apart = [abs(table.restitution - TABLE.restitution) for table, _ in near + far[:3]]
        assert max(apart) < 0.121
        GENERAL.require(far[3][0], "")
        farthest.append(abs(far[3][0].restitution - TABLE.restitution))
    assert max(farthest) > 0.3


def test_what_a_table_may_be_instead_is_thrown_onto_as_well() -> None:
    other = replace(TABLE, name="other", restitution=0.1, height=(0.1, 0.3))
    found = [table for n in range(9) for table, _ in throws_of_die((TABLE, other), False, n, 4, 0)]
    near = [table for table in found if table.name == "other"]
    assert 5 < len(near) < 22
    for table in near:
        assert abs(table.restitution - 0.1) < 0.121
        # Ranges stay as wide as they were.
        assert isinstance(table.height, tuple)
        assert table.height[1] / table.height[0] == pytest.approx(3.0)


def test_a_table_changes_no_further_than_there_are_tables(known_world: None) -> None:
    for restitution in (0.0, 0.95):
        table = replace(TABLE, restitution=restitution)
        for number in range(9):
            onto = throws_of_die((table,), False, number, 10, 0)
            assert all(abs(one.restitution - restitution) < 0.121 for one, _ in onto)
    with pytest.raises(InputError, match=r"a friction of 0\.02 to 10 .*, got 0\.01; take"):
        learn_momentum((replace(TABLE, friction=0.01),), False, 10, 30, 0, 1, workers=Inline())


def test_a_training_die_has_its_frequencies_in_the_order_of_its_basins() -> None:
    die = random_die(0, 0)
    counts = np.round(1e9 * die.poses.probabilities).astype(np.int64)
    (found,) = training_dice([ThrownRandomDie(0, die, counts, 0)], [TABLE])
    np.testing.assert_allclose(found.frequencies, found.features.odds, atol=1e-8)
    by_basin = landing_odds(found.features, found.transitions, NEAR, np)
    np.testing.assert_allclose(
        np.sort(by_basin), np.sort(momentum_odds(die.poses, die.body, NEAR)), atol=1e-12
    )


def test_deviations() -> None:
    die = random_die(1, 0)
    odds = momentum_odds(die.poses, die.body, NEAR)
    counts = np.round(1e9 * odds).astype(np.int64)
    found = deviation(ThrownRandomDie(1, die, counts, 0), NEAR)
    assert found.momentum == pytest.approx(0.0, abs=1e-8)
    expected = np.abs(odds - die.poses.probabilities).sum() / 2.0
    assert found.geometric == pytest.approx(expected, abs=1e-7)
    # De Moivre's mean absolute deviation for many throws.
    floor = np.sqrt(odds * (1.0 - odds) / (2.0 * np.pi * 1e9)).sum()
    assert found.noise_floor == pytest.approx(floor, rel=1e-3)
    assert (found.kind, found.rests, found.drops) == (die.kind, len(odds), counts.sum())
    both = mean_deviations([found, deviation(ThrownRandomDie(1, die, counts[::-1], 0), NEAR)])
    assert both.dice == 2
    assert both.worst_momentum == pytest.approx(2.0 * both.momentum, abs=1e-7)


@compiled_only
def test_dice_are_thrown_alike_by_whoever_does() -> None:
    livelier = replace(TABLE, restitution=0.78)
    plan = [[(TABLE, 30)], [(livelier, 60), (TABLE, 60)]]
    dice = list(throw_random_dice(plan, 4, Inline(), rests=(7, 13)))
    drops = [[one.counts.sum() + one.unresolved for one in of_die] for of_die in dice]
    assert drops == [[30], [60, 60]]
    (alone,) = throw_random_die(1, 4, [(TABLE, 60)], (7, 13))
    np.testing.assert_array_equal(alone.counts, dice[1][1].counts)
    assert (dice[1][0].counts != alone.counts).any()


def test_drops_that_never_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    def throw(body: RigidBody, table: Table, drops: int, seed: int, *, engine: str) -> Throws:
        weights = drop_weights(drops, "uniform")
        return Throws(table, engine, seed, np.full(drops, -1), weights, len(body.rest_heights))

    monkeypatch.setattr(random_throws, "simulate", throw)
    with pytest.raises(InputError, match=r"^table board-game: expected throws that come to rest"):
        throw_random_die(0, 0, [(TABLE, 5)])
