"""Two sets of counts: their total variation, and what chance makes of it by counting all cases."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from dicedesign.throws.two_samples import LEVEL, sampled_variation


def test_the_value_is_that_of_the_frequencies() -> None:
    found = sampled_variation([10, 30, 60], [5, 5, 10])
    assert found.value == pytest.approx((0.15 + 0.05 + 0.1) / 2.0)


def test_chance_of_a_coin_by_all_cases() -> None:
    """Of two samples of 40 and 60 with the odds of both together, 0.35."""
    heads = (11, 24)
    both = [binom.pmf(np.arange(n + 1), n, 0.35) for n in (40, 60)]
    distances = np.abs(np.arange(41)[:, None] / 40 - np.arange(61)[None, :] / 60)
    weights = np.outer(*both)
    found = sampled_variation([heads[0], 40 - heads[0]], [heads[1], 60 - heads[1]])
    assert found.noise_floor == pytest.approx((weights * distances).sum(), rel=0.03)
    # The limit is where it should be to within what 4,000 draws leave.
    for limit, least, most in ((found.limit - 0.02, 0.0, LEVEL), (found.limit + 0.02, LEVEL, 1.0)):
        assert least < weights[distances <= limit].sum() <= most


def test_equal_odds_are_beyond_chance_once_in_a_hundred_times() -> None:
    rng = np.random.default_rng(1)
    odds = [0.1, 0.2, 0.3, 0.4]
    pairs = [(rng.multinomial(300, odds), rng.multinomial(900, odds)) for _ in range(400)]
    beyond = sum(sampled_variation(*pair).beyond_chance for pair in pairs)
    assert 0 < beyond < binom.isf(1e-4, 400, 0.01)


def test_other_odds_are_found() -> None:
    assert sampled_variation([300, 700], [400, 600]).beyond_chance
    assert not sampled_variation([30, 70], [33, 67]).beyond_chance
