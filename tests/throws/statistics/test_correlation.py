"""Correlations with their uncertainty."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import betainc

from dicedesign.errors import InputError
from dicedesign.throws.correlation import Correlation, correlation

RNG = np.random.default_rng(7)
FIRST = RNG.normal(size=40)
SECOND = 0.5 * FIRST + RNG.normal(size=40)


def test_coefficient_p_value_and_interval_have_their_closed_forms() -> None:
    found = correlation(FIRST, SECOND)
    a, b = FIRST - FIRST.mean(), SECOND - SECOND.mean()
    r = float(a @ b / math.sqrt((a @ a) * (b @ b)))
    assert found.coefficient == pytest.approx(r, abs=1e-14)
    # Student's t with n - 2 degrees of freedom, t^2 = r^2 (n - 2) / (1 - r^2).
    assert found.p_value == pytest.approx(betainc(19.0, 0.5, 1.0 - r * r), rel=1e-9)
    spread = 1.959963984540054 / math.sqrt(37.0)
    low, high = (math.tanh(math.atanh(r) + sign * spread) for sign in (-1, 1))
    assert found.interval == pytest.approx((low, high), abs=1e-12)
    assert found.pairs == 40


def test_units_and_order_do_not_matter() -> None:
    order = np.random.default_rng(1).permutation(40)
    found, moved = correlation(FIRST, SECOND), correlation(SECOND[order], 3.0 * FIRST[order] + 5.0)
    assert moved.coefficient == pytest.approx(found.coefficient, abs=1e-14)
    assert moved.p_value == pytest.approx(found.p_value, rel=1e-9)


def test_it_reads_as_one_line() -> None:
    assert str(Correlation(0.4717, 1.56e-38, (0.41, 0.53), 672)) == (
        "r = 0.47 [0.41, 0.53], p = 2e-38"
    )
    assert str(Correlation(0.07, 0.0615, (-0.003, 0.147), 672)) == (
        "r = 0.07 [0.00, 0.15], p = 0.06"
    )


@pytest.mark.parametrize(
    ("first", "second"), [(FIRST, SECOND[1:]), (FIRST[:3], SECOND[:3]), (FIRST[None], SECOND[None])]
)
def test_each_body_has_both_measures(first: np.ndarray, second: np.ndarray) -> None:
    with pytest.raises(InputError, match="two measures of the same 4 or more bodies"):
        correlation(first, second)


@pytest.mark.parametrize("value", [np.nan, np.inf, 2.0])
def test_measures_are_finite_and_differ(value: float) -> None:
    with pytest.raises(InputError, match="finite values that differ between bodies"):
        correlation(FIRST, np.full(40, value))


def test_one_value_that_is_not_finite_is_enough() -> None:
    with pytest.raises(InputError, match="finite values that differ between bodies"):
        correlation(FIRST, np.append(SECOND[:-1], np.inf))
