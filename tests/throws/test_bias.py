"""What throws of several dice, or onto several tables, say of each, where probabilities are
known."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.throws.bias import Bias, Estimate, Series, expected_variation, variations_on_tables

PROBABILITIES = np.array([0.5, 0.3, 0.15, 0.05])
ALONE = np.array([1.0])


def test_one_die_of_which_nothing_was_known_has_the_frequencies_of_its_throws() -> None:
    bias, counts = Bias(np.array([[1e3]])), np.array([4000, 4000, 1500, 500])
    bias.learn(ALONE, PROBABILITIES, counts)
    estimate = bias.estimate(ALONE, PROBABILITIES)
    frequencies = counts / 1e4
    np.testing.assert_allclose(estimate.probabilities, frequencies, rtol=1e-6)
    binomial = np.sqrt(frequencies * (1.0 - frequencies) / 1e4)
    np.testing.assert_allclose(estimate.scatter, binomial, rtol=1e-3)
    np.testing.assert_allclose(
        np.exp(bias.logarithms(ALONE)), frequencies / PROBABILITIES, rtol=1e-6
    )


def test_few_throws_of_many_dice_say_what_each_does() -> None:
    """Dice and tables that change probabilities by the exponential of something linear: beliefs are
    right as often as they claim to be, also of a die that was never thrown."""
    rng = np.random.default_rng(5)
    deviations = np.array([0.4, 0.1, 0.1])
    ratios = []
    for _ in range(60):
        weights = deviations * rng.normal(size=(len(PROBABILITIES), 3))

        def true(features: np.ndarray, weights: np.ndarray = weights) -> np.ndarray:
            probabilities = PROBABILITIES * np.exp(weights @ features)
            return probabilities / probabilities.sum()

        bias = Bias(deviations[None])
        for features in rng.normal(size=(30, 2)):
            row = np.array([1.0, *features])
            bias.learn(row, PROBABILITIES, rng.multinomial(300, true(row)))
        fresh = np.array([1.0, *rng.normal(size=2)])
        estimate = bias.estimate(fresh, PROBABILITIES)
        ratios.append((estimate.probabilities - true(fresh)) / estimate.scatter)
        assert 0.5 * np.abs(estimate.probabilities - true(fresh)).sum() < 0.04
    assert np.std(ratios) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("scatter", [0.0, 0.002, 0.01, 0.1])
def test_the_expected_variation_is_the_mean_over_what_may_be(scatter: float) -> None:
    target = np.array([0.5, 0.3, 0.2])
    estimate = Estimate(np.array([0.51, 0.3, 0.19]), scatter * np.array([1.0, 0.5, 0.7]))
    drawn = estimate.probabilities + estimate.scatter * np.random.default_rng(2).normal(
        size=(200_000, 3)
    )
    mean = (np.abs(drawn - target).sum(axis=1) / 2.0).mean()
    assert expected_variation(estimate, target) == pytest.approx(mean, rel=0.01)


TARGET = np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1]) / 36.0
MEASURES = np.random.default_rng(1).normal(size=(32, 3))
TILT = 0.05 * np.random.default_rng(2).normal(size=(3, 11))


def tilted(probabilities: np.ndarray, logarithms: np.ndarray) -> np.ndarray:
    found = probabilities * np.exp(logarithms)
    return found / found.sum()


def judged(change: float, known: float, drops: int, seed: int) -> tuple[np.ndarray, object]:
    """True total variations on the tables, and what throws say, of a die whose probabilities change
    so much with the table, of which a model knows a part."""
    rng = np.random.default_rng(seed)
    true = [tilted(TARGET, change * row @ TILT) for row in MEASURES]
    others = [
        Series(tilted(TARGET, known * change * row @ TILT), rng.multinomial(drops, probabilities))
        for row, probabilities in zip(MEASURES, true, strict=True)
    ]
    meant = Series(TARGET, rng.multinomial(20 * drops, TARGET))
    found = variations_on_tables(TARGET, MEASURES, others, meant, 32 * drops)
    return np.array([0.5 * np.abs(probabilities - TARGET).sum() for probabilities in true]), found


@pytest.mark.parametrize("known", [0.0, 0.7])
def test_few_throws_onto_each_table_tell_what_the_die_does_on_all(known: float) -> None:
    true, found = judged(1.0, known, 1000, 3)
    # A thousand throws onto one table alone show three times as much of chance.
    assert np.abs(np.array(found.values) - true).max() < 0.015
    assert found.often == pytest.approx(np.quantile(true, 0.9), abs=0.008)
    assert found.worst == pytest.approx(true.max(), abs=0.01)
    assert found.often > 2.0 * found.chance_often
