"""Total variation, its noise floor by enumeration and its interval by sampling."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy import stats

from dicedesign.throws import distances as module
from dicedesign.throws.distances import (
    effective_counts,
    measure_variation,
    noise_floor,
    total_variation,
)

TWO_DICE = np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1]) / 36


def test_total_variation_is_the_largest_difference_of_any_event() -> None:
    rng = np.random.default_rng(0)
    p, q = rng.dirichlet(np.ones(6)), rng.dirichlet(np.ones(6))
    events = np.array(list(product([0.0, 1.0], repeat=6)))
    assert total_variation(p, q) == pytest.approx((events @ (p - q)).max(), abs=1e-15)
    assert total_variation(p, p) == 0.0
    assert total_variation([1, 0], [0, 1]) == 1.0


def test_no_limit_is_beyond_all_of_the_mass() -> None:
    low, high = measure_variation([0, 20], [0.999, 0.001], 0.95).interval
    assert 0.5 < low < high == 1.0


@pytest.mark.parametrize("throws", [1, 2, 6, 7, 36, 100])
@pytest.mark.parametrize("odds", [TWO_DICE, np.array([0.5, 0.5]), np.array([0.999, 0.001])])
def test_the_noise_floor_is_the_mean_over_all_counts(odds: np.ndarray, throws: int) -> None:
    counts = np.arange(throws + 1)[:, None]
    deviations = np.abs(counts / throws - odds) * stats.binom.pmf(counts, throws, odds)
    assert noise_floor(odds, throws) == pytest.approx(deviations.sum() / 2, rel=1e-12)


def test_the_noise_floor_of_the_published_sample_size() -> None:
    """0.0135 for 2d6, as found by sampling, at 8000 throws; and the normal limit at many."""
    assert noise_floor(TWO_DICE, 8_000) == pytest.approx(0.0135, abs=2e-4)
    normal = np.sqrt(2 * TWO_DICE * (1 - TWO_DICE) / np.pi / 1e8).sum() / 2
    assert noise_floor(TWO_DICE, 1e8) == pytest.approx(normal, rel=1e-6)


def test_what_is_certain_makes_no_noise() -> None:
    assert noise_floor([1.0, 0.0], 50) == 0.0
    assert noise_floor([0.4, 0.6], 50.9) == noise_floor([0.4, 0.6], 50)


def test_equal_weights_count_as_they_are() -> None:
    outcomes = np.array([0, 2, 2, 1, 2])
    np.testing.assert_allclose(effective_counts(outcomes, np.full(5, 0.3), 4), [1, 1, 3, 0])


def test_unequal_weights_have_the_variance_of_fewer_throws() -> None:
    """The variance of a weighted frequency is p (1 - p) over the effective number."""
    rng = np.random.default_rng(1)
    weights = rng.exponential(size=200)
    came = rng.random((4000, 200)) < 0.3
    frequencies = came @ weights / weights.sum()
    throws = effective_counts(came[0], weights, 2).sum()
    assert throws == pytest.approx(weights.sum() ** 2 / np.square(weights).sum())
    assert throws < 130
    assert frequencies.var() == pytest.approx(0.3 * 0.7 / throws, rel=0.08)


@pytest.mark.parametrize("throws", [60, 2_000])
@pytest.mark.parametrize(
    ("odds", "truth"),
    [
        pytest.param(TWO_DICE, TWO_DICE, id="as given"),
        pytest.param(TWO_DICE, (TWO_DICE + 1 / 11) / 2, id="flatter"),
        pytest.param(np.full(4, 0.25), np.array([0.4, 0.1, 0.25, 0.25]), id="two labels off"),
        pytest.param(np.array([0.5, 0.5]), np.array([0.5, 0.5]), id="coin"),
        pytest.param(np.array([0.98, 0.02]), np.array([0.9, 0.1]), id="rare outcome"),
    ],
)
def test_the_interval_covers(
    odds: np.ndarray, truth: np.ndarray, throws: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In 300 series of throws; the standard error of the coverage is 0.013."""
    monkeypatch.setattr(module, "DRAWS", 500)
    expected = total_variation(odds, truth)
    drawn = np.random.default_rng(2).multinomial(throws, truth, size=300)
    measured = [measure_variation(counts, odds, 0.95) for counts in drawn]
    covered = [m.interval[0] <= expected <= m.interval[1] for m in measured]
    assert np.mean(covered) >= 0.93
    if odds is truth:
        values = [m.value for m in measured]
        assert np.mean(values) == pytest.approx(measured[0].noise_floor, rel=0.08)


def test_the_interval_narrows_to_the_truth() -> None:
    truth = np.array([0.3, 0.3, 0.4])
    low, high = measure_variation(1e6 * truth, np.full(3, 1 / 3), 0.95).interval
    assert low < total_variation(truth, np.full(3, 1 / 3)) < high
    assert high - low < 0.003


def test_counts_of_one_outcome_only_leave_room_for_others() -> None:
    low, high = measure_variation([12, 0], [0.9, 0.1], 0.95).interval
    assert low == 0.0
    assert high > 0.1 + 0.05


def test_the_lower_limit_is_a_quantile_of_draws() -> None:
    counts = np.arange(1.0, 31.0)
    measured = measure_variation(counts, np.full(30, 1 / 30), 0.9)
    drawn = np.random.default_rng(0).multinomial(465, (counts + 0.5) / 480, size=module.DRAWS)
    deviations = np.abs(drawn / 465 - (counts + 0.5) / 480).sum(axis=1) / 2
    low = measured.value - np.quantile(deviations, 0.95)
    assert measured.interval[0] == pytest.approx(low, rel=1e-12)


def test_an_interval_is_the_same_each_time() -> None:
    assert measure_variation([3, 5, 9], [0.2, 0.3, 0.5], 0.9) == measure_variation(
        [3, 5, 9], [0.2, 0.3, 0.5], 0.9
    )


def test_a_confidence_next_to_1() -> None:
    _, high = measure_variation([700, 300], [0.7, 0.3], 1.0 - 2.0**-53).interval
    assert high == pytest.approx(8.2924 * np.sqrt(0.7 * 0.3 / 1000), rel=1e-3)
