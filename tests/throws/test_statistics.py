"""Statistical tests, intervals and distances, against SciPy, brute force and a published table."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from scipy import stats

from dicedesign.runtime.arrays import exact_intervals
from dicedesign.throws import distances, goodness_of_fit
from dicedesign.throws.distances import (
    jeffreys_intervals,
    jeffreys_means,
    measure_variation,
    noise_floor,
    total_variation,
)
from dicedesign.throws.goodness_of_fit import (
    chances_noticed,
    chi_square,
    exact_multinomial,
    judge_rolls,
    throws_to_confirm,
    throws_to_reject,
)


def test_chi_square_as_in_scipy() -> None:
    """Of one sample with impossible outcomes, and of two samples."""
    assert chi_square([4, 6, 0], [0.5, 0.5, 0.0]) == chi_square([4, 6], [0.5, 0.5])
    impossible = chi_square([4, 6, 1], [0.5, 0.5, 0.0])
    assert (impossible.statistic, impossible.p_value) == (math.inf, 0.0)
    assert chi_square([3], [1.0]).p_value == 1.0


@pytest.mark.parametrize(
    ("counts", "probabilities"),
    [
        ([3, 0, 1], [0.2, 0.3, 0.5]),
        ([1, 1, 1, 1], [0.25, 0.25, 0.25, 0.25]),
        ([4, 3], [0.01, 0.99]),
    ],
)
def test_the_exact_test_by_brute_force(
    counts: list[int], probabilities: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    throws, law = sum(counts), stats.multinomial(sum(counts), probabilities)
    tables = [t for t in product(range(throws + 1), repeat=len(counts)) if sum(t) == throws]
    chances = law.pmf(np.array(tables))
    expected = chances[chances <= law.pmf(counts) * (1 + 1e-9)].sum()
    result = exact_multinomial(counts, probabilities)
    assert result.p_value == pytest.approx(expected, rel=1e-9)
    assert (result.tables, result.standard_error) == (len(tables), 0.0)
    # Tables drawn at random agree with all.
    monkeypatch.setattr(goodness_of_fit, "MAX_TABLES", 0)
    drawn = exact_multinomial(counts, probabilities)
    # The observed ones are added.
    assert drawn.tables == goodness_of_fit.DRAWS + 1
    error = math.sqrt(expected * (1.0 - min(expected, 1.0)) / 1e5)
    assert drawn.p_value == pytest.approx(expected, abs=4.0 * error + 1e-5)
    assert drawn.standard_error == pytest.approx(error, rel=0.2, abs=1e-5)


@pytest.mark.parametrize("off", [3, 700])
def test_equally_likely_counts_of_many_throws(off: int) -> None:
    """Exchanged counts are equally likely, though logarithms near 1e7 are rounded."""
    few, many = 499_999 - off, 499_999 + off
    result = exact_multinomial([few, many], [0.5, 0.5])
    assert result.p_value == pytest.approx(stats.binomtest(few, 999_998, 0.5).pvalue, rel=1e-7)


PRINTED = np.array([0.1, 0.2, 0.3, 0.4])


def test_the_chance_noticed_is_that_of_the_noncentral_test() -> None:
    bias = np.array([0.01, -0.01, 0.02, -0.02])
    # The last one rests elsewhere sometimes, which the test does not see.
    several = np.array([bias, 0.0 * bias, 50.0 * bias, bias - PRINTED / 100.0])
    chances = chances_noticed(PRINTED, 1000, several)
    critical = stats.chi2.isf(0.05, 3)
    expected = stats.ncx2.sf(critical, 3, 1000 * (bias**2 / PRINTED).sum())
    np.testing.assert_allclose(chances, [expected, 0.05, 1.0, expected])
    assert chances_noticed(np.ones(1), 1000, np.zeros((2, 1))).tolist() == [0.0, 0.0]


FAIR = np.full(6, 1 / 6)


def test_a_loaded_die_is_rejected_and_a_fair_coin_is_not() -> None:
    counts = [30, 10, 10, 10, 10, 10]
    verdict, expected = judge_rolls(counts, FAIR, 0.95), stats.chisquare(counts)
    assert (verdict.throws, verdict.exact, verdict.rejected) == (80, None, True)
    assert verdict.chi_square.statistic == pytest.approx(expected.statistic)
    assert verdict.p_value == pytest.approx(expected.pvalue)
    assert verdict.to_reject < 80
    low, high = verdict.variation.interval
    assert 0.0 < low < verdict.variation.value < high
    assert verdict.variation.value == pytest.approx(30 / 80 - 1 / 6)
    verdict = judge_rolls([48, 52], [0.5, 0.5], 0.95)
    assert (verdict.rejected, verdict.variation.interval[0]) == (False, 0.0)
    # 7.849 is the noncentrality for power 0.8 at one degree of freedom.
    assert verdict.to_reject == pytest.approx(7.849 / (2 * 0.02**2 / 0.5), abs=1)
    assert judge_rolls([50, 50], [0.5, 0.5], 0.95).to_reject is None


def test_rare_outcomes_are_tested_exactly() -> None:
    verdict = judge_rolls([29, 3], [0.97, 0.03], 0.95)
    assert verdict.exact is not None
    assert verdict.p_value == pytest.approx(stats.binomtest(3, 32, 0.03).pvalue)
    # Pearson's test is not valid for rare outcomes.
    assert verdict.chi_square.p_value < 0.05 < verdict.p_value
    assert not verdict.rejected
    # Rare is an expected count below five.
    assert judge_rolls([6, 14], [0.25, 0.75], 0.95).exact is None
    assert judge_rolls([6, 13], [0.25, 0.75], 0.95).exact is not None


def test_numbers_of_throws() -> None:
    """As in Cohen's table: 87 throws with 1 and 143 with 5 degrees of freedom for w = 0.3 at level
    0.05, power 0.8; and those that confirm a perfect die."""
    assert throws_to_reject([0.65, 0.35], [0.5, 0.5], 0.05) in (87, 88)
    loaded = FAIR + 0.3 / np.sqrt(12) * np.array([1, -1, 0, 0, 0, 0])
    assert throws_to_reject(loaded, FAIR, 0.05) in (142, 143)
    throws = throws_to_confirm(FAIR, 0.02, 0.95)
    limit = noise_floor(FAIR, throws) + 1.96 * 0.5 / np.sqrt(throws)
    assert limit == pytest.approx(0.02, rel=1e-3)


# Intervals and total variation.


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
    monkeypatch.setattr(distances, "DRAWS", 500)
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
