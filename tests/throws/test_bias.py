"""Probabilities estimated from throws of several dice, or onto several tables, against known
ones."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from dicedesign.throws.bias import Bias, Estimate, expected_variation, measure_tables

PROBABILITIES = np.array([0.5, 0.3, 0.15, 0.05])
ALONE = np.array([1.0])


def test_a_vague_prior_gives_the_frequencies() -> None:
    bias, counts = Bias(np.array([[1e3]])), np.array([4000, 4000, 1500, 500])
    bias.learn(ALONE, PROBABILITIES, counts)
    estimate = bias.estimate(ALONE[None], PROBABILITIES[None])
    frequencies = counts / 1e4
    np.testing.assert_allclose(estimate.probabilities, frequencies, rtol=1e-6)
    binomial = np.sqrt(frequencies * (1.0 - frequencies) / 1e4)
    np.testing.assert_allclose(estimate.scatter, binomial, rtol=1e-3)
    np.testing.assert_allclose(
        np.exp(bias.logarithms(ALONE)), frequencies / PROBABILITIES, rtol=1e-6
    )


def test_estimates_of_a_new_die_are_calibrated() -> None:
    """Dice and tables that change the probabilities log-linearly."""
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
        # On one table, and on the mean of several.
        for rows in (fresh[None], np.column_stack([np.ones(5), rng.normal(size=(5, 2))])):
            estimate = bias.estimate(rows, np.tile(PROBABILITIES, (len(rows), 1)))
            unscaled = PROBABILITIES * np.exp(rows @ weights.T)
            mean = unscaled.sum(axis=0) / unscaled.sum()
            ratios.append((estimate.probabilities - mean) / estimate.scatter)
            assert 0.5 * np.abs(estimate.probabilities - mean).sum() < 0.04
    assert np.std(ratios) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("scatter", [0.0, 0.002, 0.01, 0.1])
def test_the_expected_variation_is_the_mean_over_the_distribution(scatter: float) -> None:
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


def tilt(logarithms: np.ndarray) -> np.ndarray:
    probabilities = TARGET * np.exp(logarithms)
    return probabilities / probabilities.sum(axis=-1, keepdims=True)


@pytest.mark.parametrize("known", [0.0, 0.7])
def test_few_throws_onto_each_table_give_the_variations_on_all(known: float) -> None:
    """known: share of the change with the table that the model predicts."""
    rng, drops = np.random.default_rng(3), 1600
    true = tilt(MEASURES @ TILT)
    predicted = tilt(known * MEASURES @ TILT)
    counts = rng.multinomial(np.full(len(true), drops), true)
    result = measure_tables(TARGET, MEASURES, predicted, counts)
    variations = 0.5 * np.abs(true - TARGET).sum(axis=1)
    # These throws onto one table alone show more by chance.
    assert np.abs(np.array(result.values) - variations).max() < 0.015
    np.testing.assert_allclose(result.probabilities, true, atol=0.02)
    assert result.often == pytest.approx(np.quantile(variations, 0.9), abs=0.008)
    assert result.worst == pytest.approx(variations.max(), abs=0.01)
    assert result.often > 2.0 * result.chance_often
    # Rolls by one hand each, tested by another library.
    rolls = rng.multinomial(1_000, np.repeat(result.probabilities, 200, axis=0))
    noticed = scipy.stats.chisquare(rolls, 1_000 * TARGET, axis=1).pvalue < 0.01
    assert result.noticed == pytest.approx(noticed.mean(), abs=0.03)


def test_a_perfect_die_is_noticed_by_chance_alone() -> None:
    counts = np.rint(1e9 * np.tile(TARGET, (32, 1))).astype(np.int64)
    result = measure_tables(TARGET, MEASURES, np.tile(TARGET, (32, 1)), counts)
    assert result.noticed == pytest.approx(0.01, abs=1e-4)
    assert result.worst < 1e-6
