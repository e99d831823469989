"""Target distributions against enumeration of all throws."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.optimize.targets import (
    Target,
    binomial,
    custom,
    equal_faces,
    fair,
    relabel,
    several_faces,
    sum_of_dice,
)


def check(target: Target, outcomes: list[int], rtol: float = 0.0) -> None:
    """Compare a target with the numbers of equally likely outcomes."""
    count = Counter(outcomes)
    values = sorted(count)
    assert target.labels == tuple(map(str, values))
    probabilities = [float(Fraction(count[value], len(outcomes))) for value in values]
    np.testing.assert_allclose(target.probabilities, probabilities, rtol=rtol)


def test_targets_count_all_throws() -> None:
    """Of coins, fair dice, and several dice."""
    for flips in (1, 2, 5, 8):
        coins = itertools.product((0, 1), repeat=flips)
        check(binomial(flips), [sum(heads) for heads in coins])
    for outcomes in (2, 3, 7, 100):
        check(fair(outcomes), list(range(1, outcomes + 1)))
    for sides in ([6], [2, 2, 2], [4, 6, 8]):
        throws = itertools.product(*(range(1, count + 1) for count in sides))
        check(sum_of_dice(sides), [sum(throw) for throw in throws], rtol=1e-14)


def test_given_probabilities_and_labels_are_kept() -> None:
    target = custom([0.5, 0.25, 0.25])
    assert target.labels == ("1", "2", "3")
    np.testing.assert_array_equal(target.probabilities, [0.5, 0.25, 0.25])
    assert relabel(target, None) is target
    renamed = relabel(target, ["a", "b", "c"])
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


def test_equal_faces_are_equally_probable_each() -> None:
    target = equal_faces(binomial(3), 8)
    assert target.face_labels == tuple("01112223")
    np.testing.assert_allclose(target.probabilities, [0.125, 0.375, 0.375, 0.125], rtol=1e-15)
    wanted, outcome_of = target.wanted
    assert wanted.tolist() == [0.125] * 8
    assert outcome_of is None


@pytest.mark.parametrize(
    ("make", "number", "beyond"),
    [
        (lambda n: equal_faces(fair(2), n), 200, 202),
        (lambda n: equal_faces(fair(20), n), 20, 19),
        (lambda n: several_faces(["a", "b"], [0.5, 0.5], [n - 100, 100]), 200, 201),
        (lambda n: several_faces(["a", "b"], [0.5, 0.5], [1, n - 1]), 2, 1),
        (fair, 200, 201),
        (fair, 2, 1),
        (lambda n: binomial(n - 1), 200, 201),
        (lambda n: binomial(n - 1), 2, 1),
        (lambda n: sum_of_dice([100, n - 99]), 200, 201),
        (lambda n: sum_of_dice([n]), 2, 1),
        (lambda n: custom([1.0 / n] * n), 200, 201),
        (lambda n: custom([1.0 / n] * n), 2, 1),
    ],
)
def test_limits_of_faces(make: Callable[[int], Target], number: int, beyond: int) -> None:
    """The numbers at the limits have dice, the next ones have none."""
    assert len(make(number).face_labels) == number
    with pytest.raises(InputError):
        make(beyond)


def test_a_number_of_faces_that_cannot_be_parted_has_a_remedy() -> None:
    with pytest.raises(InputError, match=r"got 12; take a multiple of 8"):
        equal_faces(binomial(3), 12)
