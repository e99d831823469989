"""How often Pearson's test notices dice that are off: closed forms, and dice that are rolled."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dicedesign.throws.goodness_of_fit import (
    chance_noticed,
    chances_noticed,
    weighted_chi_square_tail,
)

TARGET = np.array([0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("scale", [1.0, 2.5])
@pytest.mark.parametrize("value", [0.5, 4.0, 30.0])
def test_equal_weights_are_the_noncentral_chi_square(scale: float, value: float) -> None:
    noncentral = np.array([1.0, 0.0, 2.5])
    found = weighted_chi_square_tail(value, np.full(3, scale), noncentral)
    assert found == pytest.approx(stats.ncx2.sf(value / scale, 3, 3.5), abs=1e-11)


@pytest.mark.parametrize("value", [1.0, 10.0, 60.0])
def test_two_weights_are_an_integral(value: float) -> None:
    """Over the first number, of the other's distribution."""
    weights, noncentral = np.array([1.0, 9.0]), np.array([0.5, 2.0])
    x = np.linspace(-12.0, 12.0, 200_001)
    left = np.maximum(value - weights[0] * (x + np.sqrt(noncentral[0])) ** 2, 0.0)
    below = stats.ncx2.cdf(left / weights[1], 1, noncentral[1]) * stats.norm.pdf(x)
    expected = 1.0 - np.trapezoid(below, x)
    assert weighted_chi_square_tail(value, weights, noncentral) == pytest.approx(expected, abs=1e-5)


def test_far_from_the_target_nothing_is_missed() -> None:
    assert weighted_chi_square_tail(10.0, np.ones(3), np.array([1e5, 0.0, 0.0])) == 1.0


def test_right_dice_are_noticed_by_the_level() -> None:
    nothing = np.zeros((4, 4))
    assert chance_noticed(TARGET, 1000, nothing, np.zeros(4)) == pytest.approx(0.05, abs=1e-12)
    assert chance_noticed(np.ones(1), 1000, np.zeros((1, 1)), np.zeros(1)) == 0.0


def test_a_bias_alone_is_the_noncentral_test() -> None:
    bias = np.array([0.01, -0.01, 0.02, -0.02])
    critical = stats.chi2.isf(0.05, 3)
    expected = stats.ncx2.sf(critical, 3, 1000 * (bias**2 / TARGET).sum())
    assert chance_noticed(TARGET, 1000, np.zeros((4, 4)), bias) == pytest.approx(expected)
    several = np.array([bias, 0.0 * bias, 3.0 * bias, 50.0 * bias, bias + np.eye(4)[0] / 100.0])
    found = chances_noticed(TARGET, 1000, several)
    for one, known in zip(several[[0, 1, 2, 4]], found[[0, 1, 2, 4]], strict=True):
        assert chance_noticed(TARGET, 1000, np.zeros((4, 4)), one) == pytest.approx(known)
    assert found[3] == 1.0
    assert chances_noticed(np.ones(1), 1000, np.zeros((2, 1))).tolist() == [0.0, 0.0]


def test_dice_that_are_rolled_are_noticed_as_often() -> None:
    rng = np.random.default_rng(4)
    slopes = rng.normal(0.0, 0.008, size=(4, 6))
    slopes -= slopes.mean(axis=0)
    bias = np.array([0.006, -0.002, -0.008, 0.004])
    dice = 40_000
    odds = TARGET + bias + rng.normal(size=(dice, 6)) @ slopes.T
    counts = rng.multinomial(1000, odds)
    statistic = ((counts - 1000 * TARGET) ** 2 / (1000 * TARGET)).sum(axis=1)
    noticed = (statistic > stats.chi2.isf(0.05, 3)).mean()
    predicted = chance_noticed(TARGET, 1000, slopes @ slopes.T, bias)
    assert 0.15 < predicted < 0.6
    # Four standard errors, and what counts being whole and odds not quite the target's come to.
    assert noticed == pytest.approx(predicted, abs=4 * np.sqrt(0.25 / dice) + 0.01)
