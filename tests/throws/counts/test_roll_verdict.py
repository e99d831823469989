"""What throws say about odds, as a whole."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dicedesign.throws.counts.roll_verdict import judge_rolls

COIN = np.array([0.5, 0.5])


def test_a_loaded_die_is_rejected() -> None:
    verdict = judge_rolls([30, 10, 10, 10, 10, 10], np.full(6, 1 / 6), 0.95)
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


def test_frequencies_that_are_the_odds_leave_nothing_to_reject() -> None:
    assert judge_rolls([10, 10], COIN, 0.95).to_reject is None
    assert judge_rolls([1, 1, 1], np.full(3, 0.1 + 0.7 / 3), 0.95).to_reject is None


def test_rare_outcomes_are_tested_exactly() -> None:
    odds = np.array([0.97, 0.03])
    verdict = judge_rolls([29, 3], odds, 0.95)
    assert verdict.exact is not None
    assert verdict.p_value == pytest.approx(stats.binomtest(3, 32, 0.03).pvalue)
    # Pearson's test sees a deviation where there is too little to see.
    assert verdict.chi_square.p_value < 0.05 < verdict.p_value
    assert not verdict.rejected


def test_confidence_sets_the_level() -> None:
    p_value = judge_rolls([40, 60], COIN, 0.95).p_value
    assert 0.04 < p_value < 0.05
    assert judge_rolls([40, 60], COIN, 0.95).rejected
    strict = judge_rolls([40, 60], COIN, 0.99)
    assert not strict.rejected
    assert (np.diff(strict.intervals) > np.diff(judge_rolls([40, 60], COIN, 0.95).intervals)).all()
