"""Probabilities estimated from throws of several dice, or onto several tables, against known
ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dicedesign.throws.bias import Bias, Estimate, expected_variation, measure_tables
from dicedesign.throws.distances import noise_floor

PROBABILITIES = np.array([0.5, 0.3, 0.15, 0.05])


def tilt(probabilities: np.ndarray, logarithms: np.ndarray) -> np.ndarray:
    """Probabilities whose logarithms are changed."""
    tilted = probabilities * np.exp(logarithms)
    return tilted / tilted.sum(axis=-1, keepdims=True)


def test_estimates_of_a_new_die_are_calibrated() -> None:
    """Dice and tables that change the probabilities log-linearly, whichever prior is guessed."""
    rng, deviations, ratios = np.random.default_rng(5), np.array([0.4, 0.1, 0.1]), []
    for _ in range(60):
        weights = (deviations * rng.normal(size=(len(PROBABILITIES), 3))).T
        bias = Bias(np.array([deviations, 30.0 * deviations]))
        for row in np.insert(rng.normal(size=(30, 2)), 0, 1.0, axis=1):
            counts = rng.multinomial(300, tilt(PROBABILITIES, row @ weights))
            bias.learn(row, PROBABILITIES, counts)
        # On one table, and on the mean of several.
        for tables in (1, 5):
            rows = np.insert(rng.normal(size=(tables, 2)), 0, 1.0, axis=1)
            estimate = bias.estimate(rows, np.tile(PROBABILITIES, (tables, 1)))
            unscaled = PROBABILITIES * np.exp(rows @ weights)
            mean = unscaled.sum(axis=0) / unscaled.sum()
            ratios.append((estimate.probabilities - mean) / estimate.scatter)
            assert 0.5 * np.abs(estimate.probabilities - mean).sum() < 0.04
    assert np.std(ratios) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("scatter", [0.0, 0.01])
def test_the_expected_variation_is_the_mean_over_the_distribution(scatter: float) -> None:
    target = np.array([0.5, 0.3, 0.2])
    estimate = Estimate(np.array([0.51, 0.3, 0.19]), scatter * np.array([1.0, 0.5, 0.7]))
    noise = np.random.default_rng(2).normal(size=(200_000, 3))
    drawn = estimate.probabilities + estimate.scatter * noise
    mean = (np.abs(drawn - target).sum(axis=1) / 2.0).mean()
    assert expected_variation(estimate, target) == pytest.approx(mean, rel=0.01)


TARGET = np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1]) / 36.0


def test_few_throws_onto_each_table_give_the_variations_on_all() -> None:
    """The model predicts seven tenths of the change with the table."""
    measures = np.random.default_rng(1).normal(size=(32, 3))
    slopes = 0.05 * np.random.default_rng(2).normal(size=(3, 11))
    true, predicted = (tilt(TARGET, share * measures @ slopes) for share in (1.0, 0.7))
    rng = np.random.default_rng(3)
    counts = rng.multinomial(np.full(len(true), 1600), true)
    result = measure_tables(TARGET, measures, predicted, counts)
    variations = 0.5 * np.abs(true - TARGET).sum(axis=1)
    # These throws onto one table alone show more by chance.
    np.testing.assert_allclose(result.values, variations, atol=0.015)
    np.testing.assert_allclose(result.probabilities, true, atol=0.02)
    assert result.often == pytest.approx(np.quantile(variations, 0.9), abs=0.008)
    assert result.worst == pytest.approx(variations.max(), abs=0.01)
    assert result.often > 2.0 * result.chance_often
    # Rolls by one hand each, tested by another library.
    rolls = rng.multinomial(1_000, np.repeat(result.probabilities, 200, axis=0))
    noticed = stats.chisquare(rolls, 1_000 * TARGET, axis=1).pvalue < 0.01
    assert result.noticed == pytest.approx(noticed.mean(), abs=0.03)
    # A perfect die is noticed by chance alone.
    perfect = np.tile(TARGET, (32, 1))
    result = measure_tables(TARGET, measures, perfect, np.rint(1e9 * perfect).astype(np.int64))
    assert result.noticed == pytest.approx(0.01, abs=1e-4)
    assert result.worst < 1e-6


@pytest.mark.parametrize("off", [0.0, 0.02, 0.05])
def test_a_wrong_coin_is_noticed_as_a_normal_number_deviates(off: float) -> None:
    """With one degree of freedom, the test is that of heads against their standard deviation."""
    fair, wrong = np.array([0.6, 0.4]), np.array([0.6 + off, 0.4 - off])
    counts = np.rint(1e10 * wrong).astype(np.int64)[None]
    result = measure_tables(fair, np.zeros((1, 0)), wrong[None], counts)
    ratio = 1_000 * off / np.sqrt(1_000 * 0.6 * 0.4)
    critical = stats.norm.isf(0.005)
    expected = stats.norm.sf(critical - ratio) + stats.norm.cdf(-critical - ratio)
    assert result.noticed == pytest.approx(expected, rel=1e-4)


def test_the_effect_of_chance_is_the_mean_over_series() -> None:
    """Tables that do not differ share all throws, and with them the deviation by chance."""
    tables, throws = 5, 400
    counts = np.rint(throws * np.tile(TARGET, (tables, 1))).astype(np.int64)
    result = measure_tables(TARGET, np.zeros((tables, 0)), np.tile(TARGET, (tables, 1)), counts)
    floor = noise_floor(TARGET, int(counts.sum()))
    # Of 40 series.
    assert result.chance_often == pytest.approx(floor, rel=0.12)
    assert result.chance_worst == pytest.approx(result.chance_often, rel=1e-6)
