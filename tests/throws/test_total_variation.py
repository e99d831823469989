"""Intervals and total variation, against SciPy, enumeration and sampling."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy import stats

from dicedesign.runtime.arrays import exact_intervals
from dicedesign.throws import distances as module
from dicedesign.throws.distances import (
    jeffreys_intervals,
    jeffreys_means,
    measure_variation,
    noise_floor,
    total_variation,
)


@pytest.mark.parametrize(("throws", "confidence"), [(1, 0.95), (664, 0.999)])
def test_exact_intervals_as_in_scipy(throws: int, confidence: float) -> None:
    counts = np.unique([0, 1, throws // 3, throws - 1, throws])
    for count, interval in zip(counts, exact_intervals(counts, throws, confidence), strict=True):
        expected = stats.binomtest(int(count), throws).proportion_ci(confidence, method="exact")
        np.testing.assert_allclose(interval, expected, rtol=1e-9)


def test_the_posterior_is_a_dirichlet_distribution() -> None:
    counts = np.array([0, 3, 11])
    dirichlet = stats.dirichlet(counts + 0.5)
    np.testing.assert_allclose(jeffreys_means(counts), dirichlet.mean(), rtol=1e-14)
    quantiles = np.quantile(dirichlet.rvs(40_000, random_state=0), [0.1, 0.9], axis=0)
    np.testing.assert_allclose(jeffreys_intervals(counts, 0.8), quantiles.T, atol=0.004)


TWO_DICE = np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1]) / 36


def test_total_variation_is_the_largest_difference_of_any_event() -> None:
    rng = np.random.default_rng(0)
    p, q = rng.dirichlet(np.ones(6)), rng.dirichlet(np.ones(6))
    events = np.array(list(product([0.0, 1.0], repeat=6)))
    assert total_variation(p, q) == pytest.approx((events @ (p - q)).max(), abs=1e-15)


@pytest.mark.parametrize("throws", [1, 100])
@pytest.mark.parametrize("probabilities", [TWO_DICE, np.array([0.999, 0.001])])
def test_the_noise_floor_is_the_mean_over_all_counts(
    probabilities: np.ndarray, throws: int
) -> None:
    counts = np.arange(throws + 1)[:, None]
    deviations = np.abs(counts / throws - probabilities) * stats.binom.pmf(
        counts, throws, probabilities
    )
    assert noise_floor(probabilities, throws) == pytest.approx(deviations.sum() / 2, rel=1e-12)


@pytest.mark.parametrize(
    ("probabilities", "truth", "throws"),
    [
        pytest.param(TWO_DICE, TWO_DICE, 60, id="as given"),
        pytest.param(np.full(4, 0.25), np.array([0.4, 0.1, 0.25, 0.25]), 2000, id="two labels off"),
        pytest.param(np.array([0.98, 0.02]), np.array([0.9, 0.1]), 60, id="rare outcome"),
    ],
)
def test_the_interval_covers(
    probabilities: np.ndarray, truth: np.ndarray, throws: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In 300 series of throws; the standard error of the coverage is 0.013."""
    monkeypatch.setattr(module, "DRAWS", 500)
    expected = total_variation(probabilities, truth)
    drawn = np.random.default_rng(2).multinomial(throws, truth, size=300)
    measured = [measure_variation(counts, probabilities, 0.95) for counts in drawn]
    covered = [m.interval[0] <= expected <= m.interval[1] for m in measured]
    assert np.mean(covered) >= 0.93
    # An interval of all values would cover, too.
    widths = [high - low for low, high in (m.interval for m in measured)]
    assert np.mean(widths) < 4.0 / np.sqrt(throws)
    if probabilities is truth:
        values = [m.value for m in measured]
        assert np.mean(values) == pytest.approx(measured[0].noise_floor, rel=0.08)
