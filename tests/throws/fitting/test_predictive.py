"""p-values of counts by a prediction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.special import xlogy

from dicedesign.throws.predictions import SERIES, predicted


def test_by_odds_that_are_known_it_is_the_likelihood_ratio_test() -> None:
    """Against all possible counts."""
    throws, p = 30, 0.3
    every = np.arange(throws + 1)
    counts = np.stack([every, throws - every], axis=1)
    ratio = 2.0 * (xlogy(counts, counts / throws) - counts * np.log([p, 1.0 - p])).sum(axis=1)
    for came in (4, 9, 15):
        exact = stats.binom.pmf(every[ratio >= ratio[came] - 1e-9], throws, p).sum()
        found = predicted(counts[came], np.array([[p, 1.0 - p]]), np.random.default_rng(came))
        assert found.p_value == pytest.approx(exact, abs=4.0 * found.standard_error + 1e-3)
        assert found.odds == pytest.approx([p, 1.0 - p])
        assert found.deviation == pytest.approx([0.0, 0.0], abs=1e-12)


def test_p_values_of_what_is_drawn_from_the_prediction_are_uniform() -> None:
    rng = np.random.default_rng(3)
    odds = rng.dirichlet([3.0, 5.0, 8.0], 300)
    found = [
        predicted(rng.multinomial(400, row), odds, rng).p_value
        for row in rng.permutation(odds)[:80]
    ]
    assert stats.kstest(found, "uniform").pvalue > 0.01


def test_the_outcome_that_is_least_as_predicted() -> None:
    odds = np.tile([0.1, 0.3, 0.6], (50, 1))
    found = predicted(np.array([60, 90, 150]), odds, np.random.default_rng(4))
    assert found.worst == 0
    low, high = found.interval
    assert [low, high] == pytest.approx(stats.binom.ppf([0.025, 0.975], 300, 0.1), abs=1)
    assert found.p_value == pytest.approx(1.0 / (SERIES + 1))
