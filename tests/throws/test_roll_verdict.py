"""Verdicts on throws, and how many throws they take."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dicedesign.throws.distances import noise_floor
from dicedesign.throws.goodness_of_fit import judge_rolls, throws_to_confirm, throws_to_reject

COIN = np.array([0.5, 0.5])
FAIR = np.full(6, 1 / 6)


def test_a_loaded_die_is_rejected() -> None:
    verdict = judge_rolls([30, 10, 10, 10, 10, 10], FAIR, 0.95)
    assert (verdict.throws, verdict.exact) == (80, None)
    assert verdict.rejected
    assert verdict.p_value == pytest.approx(stats.chisquare([30, 10, 10, 10, 10, 10]).pvalue)
    assert verdict.to_reject is not None
    assert verdict.to_reject < 80
    low, high = verdict.variation.interval
    assert 0.0 < low < verdict.variation.value < high
    assert verdict.variation.value == pytest.approx(30 / 80 - 1 / 6)


def test_a_fair_coin_is_not_rejected() -> None:
    verdict = judge_rolls([48, 52], COIN, 0.95)
    assert not verdict.rejected
    assert verdict.variation.interval[0] == 0.0
    # 7.849 is the noncentrality for power 0.8 at one degree of freedom.
    assert verdict.to_reject == pytest.approx(7.849 / (2 * 0.02**2 / 0.5), abs=1)
    np.testing.assert_allclose(verdict.frequencies, [0.48, 0.52])


def test_rare_outcomes_are_tested_exactly() -> None:
    odds = np.array([0.97, 0.03])
    verdict = judge_rolls([29, 3], odds, 0.95)
    assert verdict.exact is not None
    assert verdict.p_value == pytest.approx(stats.binomtest(3, 32, 0.03).pvalue)
    # Pearson's test sees a deviation where there is too little to see.
    assert verdict.chi_square.p_value < 0.05 < verdict.p_value
    assert not verdict.rejected


def test_as_in_cohens_table() -> None:
    """87 throws with 1 and 143 with 5 degrees of freedom for w = 0.3 at level 0.05, power 0.8."""
    coin = np.array([0.65, 0.35])
    assert throws_to_reject(coin, [0.5, 0.5], 0.05, 0.8) in (87, 88)
    side = 0.3 / np.sqrt(12)
    loaded = FAIR + np.array([side, -side, 0, 0, 0, 0])
    assert throws_to_reject(loaded, FAIR, 0.05, 0.8) in (142, 143)


def test_a_perfect_die_shows_to_be_one() -> None:
    throws = throws_to_confirm(FAIR, 0.02, 0.95)
    limit = noise_floor(FAIR, throws) + 1.96 * 0.5 / np.sqrt(throws)
    assert limit == pytest.approx(0.02, rel=1e-3)
    assert throws_to_confirm(FAIR, 0.01, 0.95) == pytest.approx(4 * throws, abs=4)
