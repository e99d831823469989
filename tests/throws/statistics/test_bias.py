"""What throws of several dice say of each of them, in worlds whose odds are known."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.throws.bias import Belief, Bias, expected_variation

ODDS = np.array([0.5, 0.3, 0.15, 0.05])
ALONE = np.array([1.0])


def test_one_die_of_which_nothing_was_known_has_the_frequencies_of_its_throws() -> None:
    bias, counts = Bias(np.array([[1e3]])), np.array([4000, 4000, 1500, 500])
    bias.learn(ALONE, ODDS, counts)
    belief = bias.belief(ALONE, ODDS)
    frequencies = counts / 1e4
    np.testing.assert_allclose(belief.odds, frequencies, rtol=1e-6)
    binomial = np.sqrt(frequencies * (1.0 - frequencies) / 1e4)
    np.testing.assert_allclose(belief.scatter, binomial, rtol=1e-3)
    np.testing.assert_allclose(np.exp(bias.logarithms(ALONE)), frequencies / ODDS, rtol=1e-6)


def test_throws_that_say_nothing_leave_the_model() -> None:
    bias = Bias(np.array([[1e-6]]))
    bias.learn(ALONE, ODDS, np.array([10, 90, 0, 0]))
    belief = bias.belief(ALONE, ODDS)
    np.testing.assert_allclose(belief.odds, ODDS, rtol=1e-6)
    assert belief.scatter.max() < 1e-6


def test_an_outcome_that_never_came_up_has_little_odds_but_some() -> None:
    bias = Bias(np.array([[0.5]]))
    bias.learn(ALONE, ODDS, np.array([520, 320, 160, 0]))
    assert 0.0 < bias.belief(ALONE, ODDS).odds[3] < 0.02


def test_few_throws_of_many_dice_say_what_each_does() -> None:
    """Dice and tables that change odds by the exponential of something linear: beliefs are right
    as often as they claim to be, also of a die that was never thrown."""
    rng = np.random.default_rng(5)
    deviations = np.array([0.4, 0.1, 0.1])
    ratios = []
    for _ in range(60):
        weights = deviations * rng.normal(size=(len(ODDS), 3))

        def true(features: np.ndarray, weights: np.ndarray = weights) -> np.ndarray:
            odds = ODDS * np.exp(weights @ features)
            return odds / odds.sum()

        bias = Bias(deviations[None])
        for features in rng.normal(size=(30, 2)):
            row = np.array([1.0, *features])
            bias.learn(row, ODDS, rng.multinomial(300, true(row)))
        fresh = np.array([1.0, *rng.normal(size=2)])
        belief = bias.belief(fresh, ODDS)
        ratios.append((belief.odds - true(fresh)) / belief.scatter)
        assert 0.5 * np.abs(belief.odds - true(fresh)).sum() < 0.04
    assert np.std(ratios) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("true", [0.01, 0.3])
def test_how_large_weights_are_is_learned_too(true: float) -> None:
    """Little throws of dice that differ say as much of each other as they do."""
    rng = np.random.default_rng(8)
    guesses = np.array([[0.4, 0.01], [0.4, 0.3]])
    weights = np.array([0.0, true]) * rng.normal(size=(len(ODDS), 2))
    found = [Bias(guesses), *(Bias(guess[None]) for guess in guesses)]
    for feature in rng.normal(size=20):
        row = np.array([1.0, feature])
        odds = ODDS * np.exp(weights @ row)
        counts = rng.multinomial(2000, odds / odds.sum())
        for bias in found:
            bias.learn(row, ODDS, counts)
    at = np.array([1.0, 1.0])
    best, small, large = (bias.belief(at, ODDS).scatter for bias in found)
    np.testing.assert_array_equal(best, small if true == 0.01 else large)
    assert small.sum() < large.sum()


def test_logarithms_of_many_at_once() -> None:
    bias = Bias(np.array([[0.4, 0.2]]))
    bias.learn(np.array([1.0, 0.3]), ODDS, np.array([400, 380, 140, 80]))
    rows = np.array([[1.0, 0.0], [1.0, 0.3], [1.0, -2.0]])
    for row, found in zip(rows, bias.logarithms(rows), strict=True):
        np.testing.assert_array_equal(found, bias.logarithms(row))


@pytest.mark.parametrize("scatter", [0.0, 0.002, 0.01, 0.1])
def test_the_expected_variation_is_the_mean_over_what_may_be(scatter: float) -> None:
    target = np.array([0.5, 0.3, 0.2])
    belief = Belief(np.array([0.51, 0.3, 0.19]), scatter * np.array([1.0, 0.5, 0.7]))
    drawn = belief.odds + belief.scatter * np.random.default_rng(2).normal(size=(200_000, 3))
    mean = (np.abs(drawn - target).sum(axis=1) / 2.0).mean()
    assert expected_variation(belief, target) == pytest.approx(mean, rel=0.01)
