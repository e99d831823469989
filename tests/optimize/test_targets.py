"""Target distributions against enumeration of all throws."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.optimize.targets import (
    Target,
    binomial,
    custom,
    fair,
    relabel,
    several_faces,
    sum_of_dice,
)


def enumerate_sums(outcomes: list[int]) -> tuple[tuple[str, ...], list[float]]:
    count = Counter(outcomes)
    values = sorted(count)
    probabilities = [float(Fraction(count[value], len(outcomes))) for value in values]
    return tuple(str(value) for value in values), probabilities


@pytest.mark.parametrize("flips", [1, 2, 5, 8])
def test_binomial_counts_heads(flips: int) -> None:
    labels, probabilities = enumerate_sums(
        [sum(coins) for coins in itertools.product((0, 1), repeat=flips)]
    )
    target = binomial(flips)
    assert target.labels == labels
    np.testing.assert_array_equal(target.probabilities, probabilities)


@pytest.mark.parametrize("sides", [[6], [2, 2, 2], [4, 6, 8]])
def test_sum_of_dice_counts_totals(sides: list[int]) -> None:
    throws = itertools.product(*(range(1, count + 1) for count in sides))
    labels, probabilities = enumerate_sums([sum(throw) for throw in throws])
    target = sum_of_dice(sides)
    assert target.labels == labels
    np.testing.assert_allclose(target.probabilities, probabilities, rtol=1e-14)


@pytest.mark.parametrize("outcomes", [2, 3, 7, 100])
def test_fair_counts_each_face_once(outcomes: int) -> None:
    labels, probabilities = enumerate_sums(list(range(1, outcomes + 1)))
    target = fair(outcomes)
    assert target.labels == labels
    np.testing.assert_array_equal(target.probabilities, probabilities)


def test_custom_keeps_values() -> None:
    target = custom([0.5, 0.25, 0.25])
    assert target.labels == ("1", "2", "3")
    np.testing.assert_array_equal(target.probabilities, [0.5, 0.25, 0.25])
    assert custom([1 / 3] * 3).probabilities.dtype == np.float64


def test_relabeled_keeps_the_distribution() -> None:
    target = fair(3)
    assert relabel(target, None) is target
    renamed = relabel(target, ["a", "b", "c"])
    assert isinstance(renamed, Target)
    assert renamed.labels == ("a", "b", "c")
    np.testing.assert_array_equal(renamed.probabilities, target.probabilities)


def test_faces_with_one_label_are_one_outcome() -> None:
    target = relabel(custom([0.1, 0.2, 0.3, 0.4]), ["a", "b", "a", "c"])
    assert target.labels == ("a", "b", "c")
    np.testing.assert_allclose(target.probabilities, [0.4, 0.2, 0.4], rtol=1e-15)
    np.testing.assert_array_equal(target.outcome_of_face, [0, 1, 0, 2])
    shared = several_faces(["+", "-"], [0.75, 0.25], [3, 1])
    np.testing.assert_allclose(shared.face_probabilities, [0.25] * 4, rtol=1e-15)
    assert shared.face_labels == ("+", "+", "+", "-")


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: binomial(0), "binomial: expected a whole number of at least 1, got 0"),
        (lambda: fair(1), "fair: expected a whole number of at least 2, got 1"),
        (lambda: sum_of_dice([]), "sum_of_dice: expected at least one number of sides, got none"),
        (
            lambda: sum_of_dice([6, 1]),
            "sum_of_dice: expected a whole number of at least 2, got 1",
        ),
        (lambda: custom([1.0]), "probabilities: expected at least two, got [1.0]"),
        (
            lambda: custom([0.0, 1.0]),
            "probabilities: expected numbers between 0 and 1, got 0; leave out outcomes that "
            "never happen",
        ),
        (lambda: custom([float("nan"), 0.5]), "expected numbers between 0 and 1, got nan"),
        (
            lambda: custom([0.3, 0.3, 0.3]),
            "probabilities: expected a sum of 1, got 0.9; write fractions such as 1/3",
        ),
        (
            lambda: relabel(fair(2), ["a"]),
            "labels: expected 2, one for each probability, got 1",
        ),
        (
            lambda: relabel(fair(3), ["a", "a", "a"]),
            "labels: expected at least two different ones, got 'a' alone",
        ),
        (
            lambda: several_faces(["a", "b", "a"], [1 / 3] * 3, [1, 2, 1]),
            "outcomes: expected distinct labels, got 'a' more than once",
        ),
        (
            lambda: several_faces(["a", "b"], [0.5, 0.5], [0, 2]),
            "faces: expected a whole number of at least 1, got 0",
        ),
    ],
)
def test_bad_targets_are_refused_in_words(make, text: str) -> None:
    with pytest.raises(InputError, match=re.escape(text)):
        make()


def test_too_many_outcomes_are_refused_at_once() -> None:
    for make in (
        lambda: binomial(10**9),
        lambda: sum_of_dice([10**9]),
        lambda: fair(10**11),
        lambda: custom([1 / 300] * 300),
    ):
        with pytest.raises(InputError, match="expected at most 200 outcomes, got"):
            make()
