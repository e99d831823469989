"""Intervals of one probability, against the definition, SciPy and sampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dicedesign.runtime.intervals import exact_intervals
from dicedesign.throws.distances import jeffreys_posterior


@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.999])
@pytest.mark.parametrize("throws", [1, 7, 664])
def test_exact_intervals_as_in_scipy(throws: int, confidence: float) -> None:
    counts = np.unique([0, 1, throws // 3, throws - 1, throws])
    for count, interval in zip(counts, exact_intervals(counts, throws, confidence), strict=True):
        expected = stats.binomtest(int(count), throws).proportion_ci(confidence, method="exact")
        np.testing.assert_allclose(interval, expected, rtol=1e-9)


def test_the_limits_are_where_the_counts_are_just_too_improbable() -> None:
    (low, high) = exact_intervals(5, 40, 0.9)
    assert stats.binom.sf(4, 40, low) == pytest.approx(0.05, rel=1e-9)
    assert stats.binom.cdf(5, 40, high) == pytest.approx(0.05, rel=1e-9)


def test_nothing_and_everything() -> None:
    (none, every) = exact_intervals([0, 20], 20, 0.95)
    assert none == pytest.approx([0.0, 1.0 - 0.025 ** (1 / 20)])
    assert every == pytest.approx([0.025 ** (1 / 20), 1.0])


@pytest.mark.parametrize("p", [0.003, 0.1, 0.5])
def test_the_exact_intervals_cover_at_least_what_they_say(p: float) -> None:
    """By the sum over all counts, not by sampling."""
    counts = np.arange(61)
    low, high = exact_intervals(counts, 60, 0.9).T
    covered = stats.binom.pmf(counts, 60, p)[(low <= p) & (p <= high)].sum()
    assert covered >= 0.9


def test_the_posterior_is_that_of_a_dirichlet_distribution() -> None:
    counts = np.array([0, 3, 11])
    posterior = jeffreys_posterior(counts, 0.8)
    dirichlet = stats.dirichlet(counts + 0.5)
    np.testing.assert_allclose(posterior.means, dirichlet.mean(), rtol=1e-14)
    drawn = dirichlet.rvs(40_000, random_state=0)
    np.testing.assert_allclose(
        posterior.intervals, np.quantile(drawn, [0.1, 0.9], axis=0).T, atol=0.004
    )
    within = (posterior.intervals[:, 0] < posterior.means).all()
    assert within


def test_a_confidence_next_to_1_leaves_limits_below_it() -> None:
    """The part above is 5.6e-17, which no difference from 1 has room for."""
    intervals = jeffreys_posterior([0, 5, 5], 1.0 - 2.0**-53).intervals
    weights = np.array([0.5, 5.5, 5.5])
    above = stats.beta.sf(intervals[:, 1], weights, 11.5 - weights)
    np.testing.assert_allclose(above, 2.0**-54, rtol=1e-6)
