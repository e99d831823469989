"""Rounds of throwing and designing anew, in a world where the model's mistake is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.options import RefineOptions
from dicedesign.optimize.refinement import Refinement
from dicedesign.optimize.result import DesignResult
from dicedesign.results.status import Status

TARGET = np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1]) / 36.0
ALONE = np.arange(11)
CHANGES = (0.2, -0.2)
CUBE = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T.astype(float)


def die_with(odds: np.ndarray) -> DesignResult:
    """A stand-in that carries its odds in the model where a die has its directions."""
    return DesignResult(Status.CONVERGED, convex_hull(CUBE), odds, 0.0, {}, (), 0, 0, 0)


def tilted(odds: np.ndarray, change: float) -> np.ndarray:
    """Odds of which the first ones are larger the more, the larger the change is."""
    found = odds * np.exp(change * np.linspace(0.5, -0.5, len(odds)))
    return found / found.sum()


class World:
    """Dice whose true odds are those in the model times fixed factors, and a bit more."""

    def __init__(self, factors: np.ndarray, drift: float = 0.0) -> None:
        self.factors, self.drift = factors, drift
        self.drops: list[int] = []
        self.numbers: list[int] = []
        self.others: list[int] = []

    def true_odds(self, die: DesignResult) -> np.ndarray:
        odds = die.directions * self.factors * np.exp(self.drift * np.sqrt(die.directions))
        return odds / odds.sum()

    def throw(
        self, die: DesignResult, drops: int, number: int, other: int
    ) -> tuple[np.ndarray, np.ndarray]:
        self.drops.append(drops)
        self.numbers.append(number)
        self.others.append(other)
        change = (0.0, *CHANGES)[other]
        true, known = self.true_odds(die), die.directions
        if change:
            known = tilted(known, change)
            true = tilted(true, -3.0 * change)
        series = np.random.default_rng([number, other] if other else number)
        return series.multinomial(drops, np.append(true, 0.0)), known

    def refined(self, **changes: object) -> tuple[DesignResult, tuple]:
        refinement = Refinement(
            TARGET,
            ALONE,
            20_000,
            5,
            0,
            self.throw,
            lambda die, odds, bias: die_with(odds),
            lambda thrown: None,
        )
        return replace(refinement, **changes).refine(die_with(TARGET))


FACTORS = np.exp(np.random.default_rng(3).normal(scale=0.3, size=11))


def test_rounds_lead_to_the_target_to_within_the_sampling_error() -> None:
    world = World(FACTORS, drift=0.5)
    die, rounds = world.refined()
    assert rounds[0].deviation > 0.08
    assert 0.5 * np.abs(world.true_odds(die) - TARGET).sum() < 0.006
    assert rounds[-1].deviation < rounds[0].deviation / 5.0


def test_samples_grow_and_are_fresh() -> None:
    world = World(FACTORS, drift=0.5)
    world.refined()
    assert len(set(world.numbers)) == len(world.numbers)
    assert (np.diff(world.drops) > 0).all()


def test_a_die_without_mistake_is_left_as_it_is() -> None:
    # Of a perfect die about half of the rounds see less than the mean deviation.
    world = World(np.ones(11))
    die, rounds = world.refined()
    assert rounds[-1].deviation <= rounds[-1].noise_floor
    assert 0.5 * np.abs(world.true_odds(die) - TARGET).sum() < 0.01


def test_outcomes_of_one_orbit_are_corrected_alike() -> None:
    orbits = np.array([0, 1, 2, 3, 4, 5, 4, 3, 2, 1, 0])
    world = World(FACTORS[orbits])
    die, _ = world.refined(orbits=orbits)
    np.testing.assert_allclose(die.directions, die.directions[::-1], rtol=1e-12)


def test_a_correction_without_a_die_is_halved() -> None:
    world, refused = World(FACTORS), []

    def design(die: DesignResult, odds: np.ndarray, bias: np.ndarray | None) -> DesignResult | None:
        if 0.5 * np.abs(odds - die.directions).sum() > 0.05:
            refused.append(odds)
            return None
        return die_with(odds)

    die, _ = world.refined(design=design)
    assert refused
    assert 0.5 * np.abs(world.true_odds(die) - TARGET).sum() < 0.02


def test_an_outcome_that_never_comes_up_is_asked_for_more_often() -> None:
    factors = np.ones(11)
    factors[0] = 0.0
    world = World(factors)
    die, _ = world.refined(rounds=1)
    assert die.directions[0] > 10.0 * TARGET[0]


def test_what_other_tables_do_is_learned() -> None:
    world = World(FACTORS, drift=0.5)
    told: list[np.ndarray | None] = []

    def design(die: DesignResult, odds: np.ndarray, bias: np.ndarray | None) -> DesignResult:
        told.append(bias)
        return die_with(odds)

    die, rounds = world.refined(others=2, design=design, rounds=4)
    assert [len(thrown.changed) for thrown in rounds] == [2, 2, 0, 0][: len(rounds)]
    assert world.others == [0, 1, 2, 0, 1, 2, 0, 0][: len(world.others)]
    assert world.drops[:3] == [20_000, 10_000, 10_000]
    assert len(told) > 2
    assert all(bias is None for bias in told[2:])
    true, known = world.true_odds(die), die.directions
    assert told[1] is not None
    for change, bias in zip(CHANGES, told[1], strict=True):
        expected = np.log(tilted(true, -3.0 * change) / tilted(known, change))
        np.testing.assert_allclose(bias, expected, atol=0.15)
    assert np.abs(told[1][0] - told[1][1]).max() > 0.5
    seen = [0.5 * np.abs(tilted(TARGET, 3.0 * change) - TARGET).sum() for change in CHANGES]
    np.testing.assert_allclose(rounds[1].changed, seen, atol=0.03)


def test_a_robust_die_is_designed_anew_at_least_once_and_keeps_right_odds() -> None:
    world = World(np.ones(11))
    die, rounds = world.refined(others=2, rounds=1)
    assert rounds[0].deviation <= rounds[0].noise_floor
    np.testing.assert_array_equal(die.directions, TARGET)
    _, rounds = world.refined(others=2)
    assert len(rounds) > 1


@pytest.mark.parametrize(("rounds", "thrown"), [(1, [2]), (2, [2, 0]), (3, [2, 0, 0])])
def test_the_last_rounds_settle_but_never_the_first(rounds: int, thrown: list[int]) -> None:
    _, history = World(FACTORS, drift=2.0).refined(others=2, rounds=rounds)
    assert [len(one.changed) for one in history] == thrown


def test_the_rounds_end_where_no_die_is_found() -> None:
    world = World(FACTORS)
    die, rounds = world.refined(design=lambda die, odds, bias: None)
    assert len(rounds) == 1
    np.testing.assert_array_equal(die.directions, TARGET)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"drops": 0}, "refine.drops: expected a whole number from 1 to 10000000, got 0"),
        ({"rounds": 0}, "refine.rounds: expected a whole number from 1 to 50, got 0"),
        ({"verdict": -1}, "refine.verdict: expected a whole number from 1 to 10000000, got -1"),
        ({"within": 1.0}, r"refine.within: expected a number in \(0, 1\), got 1"),
    ],
)
def test_impossible_options_are_errors(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        RefineOptions(**options)


def test_a_die_that_its_symmetry_makes_right_is_left_alone() -> None:
    world, fair = World(np.ones(11)), np.full(11, 1 / 11)
    die, rounds = Refinement(
        fair, np.zeros(11, dtype=np.int64), 100, 5, False, world.throw, lambda die, odds, bias: None
    ).refine(die_with(fair))
    assert len(rounds) == 1
    np.testing.assert_array_equal(die.directions, fair)
