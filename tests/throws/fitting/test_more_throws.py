"""What more throws would tell, against the inverse of Fisher's information."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.throws.predictions import expected_deviations


def test_one_parameter_on_which_two_odds_depend() -> None:
    """Normal to a good approximation: precisions add up."""
    value = np.random.default_rng(0).normal(0.5, 0.02, 100_000)
    odds = np.stack([value, 1.0 - value], axis=1)
    found = expected_deviations(value[:, None], odds, [100, 1000])
    for count, left in zip((100, 1000), found[:, 0], strict=True):
        assert left == pytest.approx((1.0 / 0.02**2 + count / 0.25) ** -0.5, rel=0.01)


def test_what_the_odds_do_not_depend_on_stays_open() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=(50_000, 2)) * [0.02, 3.0]
    odds = np.stack([0.2 + values[:, 0], 0.3 - values[:, 0], np.full(50_000, 0.5)], axis=1)
    ((first, second),) = expected_deviations(values, odds, [10**7])
    assert first < 0.001
    assert second == pytest.approx(3.0, rel=0.02)


def test_sessions_of_their_own_bound_what_one_can_tell() -> None:
    """Half of the variance of the odds is of the session."""
    rng = np.random.default_rng(2)
    value, session = rng.normal(size=(2, 100_000)) * 0.02
    odds = np.stack([0.5 + value + session, 0.5 - value - session], axis=1)
    ((left,),) = expected_deviations(value[:, None], odds, [10**8])
    assert left == pytest.approx(0.02 * 0.5**0.5, rel=0.02)
