"""Intervals and distances, against SciPy, enumeration, another library and sampling."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy import stats

from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.runtime.arrays import exact_intervals
from dicedesign.throws import distances as module
from dicedesign.throws.distances import (
    jeffreys_intervals,
    jeffreys_means,
    measure_transport,
    measure_variation,
    noise_floor,
    total_variation,
    wasserstein_distance,
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
    assert total_variation(p, p) == 0.0
    assert total_variation([1, 0], [0, 1]) == 1.0


@pytest.mark.parametrize("throws", [1, 7, 100])
@pytest.mark.parametrize(
    "probabilities", [TWO_DICE, np.array([0.5, 0.5]), np.array([0.999, 0.001])]
)
def test_the_noise_floor_is_the_mean_over_all_counts(
    probabilities: np.ndarray, throws: int
) -> None:
    counts = np.arange(throws + 1)[:, None]
    deviations = np.abs(counts / throws - probabilities) * stats.binom.pmf(
        counts, throws, probabilities
    )
    assert noise_floor(probabilities, throws) == pytest.approx(deviations.sum() / 2, rel=1e-12)


@pytest.mark.parametrize("throws", [60, 2_000])
@pytest.mark.parametrize(
    ("probabilities", "truth"),
    [
        pytest.param(TWO_DICE, TWO_DICE, id="as given"),
        pytest.param(np.full(4, 0.25), np.array([0.4, 0.1, 0.25, 0.25]), id="two labels off"),
        pytest.param(np.array([0.98, 0.02]), np.array([0.9, 0.1]), id="rare outcome"),
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
    if probabilities is truth:
        values = [m.value for m in measured]
        assert np.mean(values) == pytest.approx(measured[0].noise_floor, rel=0.08)


X, Y, _ = np.eye(3)


def distribution(seed: int, count: int, spread: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Random directions and weights; a small spread makes most weights tiny."""
    rng = np.random.default_rng(seed)
    weights = np.maximum(rng.dirichlet(np.full(count, spread)), 10 ** rng.uniform(-14, -5, count))
    return unit_vectors(rng.normal(size=(count, 3))), weights / weights.sum()


@pytest.mark.parametrize("spread", [1.0, 0.03])
@pytest.mark.parametrize("count", [2, 11, 60])
def test_against_another_library(count: int, spread: float) -> None:
    ot = pytest.importorskip("ot")
    for seed in range(5):
        (a, p), (b, q) = distribution(seed, count, spread), distribution(99 + seed, count + 3)
        expected = ot.emd2(p, q, angle_between(a[:, None], b))
        assert wasserstein_distance(a, p, b, q) == pytest.approx(expected, abs=1e-8)
        # Both at the same rests.
        other = distribution(seed + 50, count, spread)[1]
        expected = ot.emd2(p, other, angle_between(a[:, None], a))
        assert wasserstein_distance(a, p, a, other) == pytest.approx(expected, abs=1e-8)


def test_distance_between_two_rests_is_their_angle_times_the_total_variation() -> None:
    measured = measure_transport([X, Y], [60, 40], [0.5, 0.5], 0.95)
    assert measured.value == pytest.approx(0.1 * np.pi / 2)
    # The mean of 200 draws, within four standard errors.
    expected = noise_floor([0.5, 0.5], 100) * np.pi / 2
    assert measured.noise_floor == pytest.approx(expected, rel=4 * 0.76 / np.sqrt(200))
    low, high = measured.interval
    assert 0.0 <= low < measured.value < high
    # 1.96 standard errors of the frequency to either side.
    assert high - measured.value == pytest.approx(1.96 * 0.049 * np.pi / 2, rel=0.15)
