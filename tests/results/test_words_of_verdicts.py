"""Verdicts in words: which outcome they name, and how they round."""

from __future__ import annotations

import math

import pytest

from dicedesign.results.verdict import percentage_points, worst_outcome


def test_the_worst_outcome_is_the_farthest_from_its_own_probability() -> None:
    """Not that with the largest difference."""
    clause = worst_outcome(("a", "b", "c"), (0.46, 0.34, 0.2), (0.5, 0.3, 0.2))
    assert clause.startswith("b ")
    assert clause.index("34 %") < clause.index("30 %")
    rare = worst_outcome(("a", "b", "c"), (0.52, 0.463, 0.017), (0.53, 0.45, 0.02))
    assert rare.startswith("c ")


@pytest.mark.parametrize("error", [1e-9, 0.000123, 0.00999, 0.0101, 0.0999, 0.5])
def test_errors_are_rounded_up_to_two_digits(error: float) -> None:
    number, *_ = percentage_points(error).split()
    assert "e" not in number
    digits = 10.0 ** (math.floor(math.log10(100.0 * error)) - 1)
    assert -1e-9 * digits <= float(number) - 100.0 * error < digits


def test_one_percentage_point_is_in_the_singular() -> None:
    assert [percentage_points(error)[-1] for error in (0.01, 0.011, 0.1)] == ["t", "s", "s"]
