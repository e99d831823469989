"""Numbers of throws, against SciPy, a published table and sampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dicedesign.throws.counts.roll_verdict import throws_to_confirm, throws_to_reject
from dicedesign.throws.statistics.goodness_of_fit import chi_square
from dicedesign.throws.statistics.total_variation import noise_floor

FAIR = np.full(6, 1 / 6)


def test_as_in_cohens_table() -> None:
    """87 throws with 1 and 143 with 5 degrees of freedom for w = 0.3 at level 0.05, power 0.8."""
    coin = np.array([0.65, 0.35])
    assert throws_to_reject(coin, [0.5, 0.5], 0.05, 0.8) in (87, 88)
    side = 0.3 / np.sqrt(12)
    loaded = FAIR + np.array([side, -side, 0, 0, 0, 0])
    assert throws_to_reject(loaded, FAIR, 0.05, 0.8) in (142, 143)


@pytest.mark.parametrize("outcomes", [2, 11, 150])
def test_the_noncentral_law_has_the_power_there(outcomes: int) -> None:
    rng = np.random.default_rng(outcomes)
    truth, odds = rng.dirichlet(np.full(outcomes, 9.0)), rng.dirichlet(np.full(outcomes, 9.0))
    throws = throws_to_reject(truth, odds, 0.01, 0.9)
    effect = ((truth - odds) ** 2 / odds).sum()
    limit = stats.chi2.isf(0.01, outcomes - 1)
    power = [stats.ncx2.sf(limit, outcomes - 1, n * effect) for n in (throws - 1, throws)]
    assert power[0] < 0.9 + 1e-6
    assert power[1] >= 0.9 - 1e-6


def test_so_many_throws_reject_as_often() -> None:
    """Of 2000 series; the standard error is 0.009."""
    truth = np.array([0.22, 0.18, 0.15, 0.15, 0.15, 0.15])
    throws = throws_to_reject(truth, FAIR, 0.05, 0.8)
    drawn = np.random.default_rng(0).multinomial(throws, truth, size=2000)
    rejected = [chi_square(counts, FAIR).p_value <= 0.05 for counts in drawn]
    assert np.mean(rejected) == pytest.approx(0.8, abs=0.03)


def test_a_perfect_die_shows_to_be_one() -> None:
    throws = throws_to_confirm(FAIR, 0.02, 0.95)
    limit = noise_floor(FAIR, throws) + 1.96 * 0.5 / np.sqrt(throws)
    assert limit == pytest.approx(0.02, rel=1e-3)
    assert throws_to_confirm(FAIR, 0.01, 0.95) == pytest.approx(4 * throws, abs=4)


def test_a_confidence_next_to_1_takes_more_throws_and_not_infinitely_many() -> None:
    """5.6e-17 of a normal distribution are beyond 8.29 standard deviations."""
    throws = throws_to_confirm(FAIR, 0.02, 1.0 - 2.0**-53)
    limit = noise_floor(FAIR, throws) + 8.2924 * 0.5 / np.sqrt(throws)
    assert limit == pytest.approx(0.02, rel=1e-3)
