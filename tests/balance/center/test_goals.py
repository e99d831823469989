"""Goals that cannot be meant."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dicedesign.balance.center.goals import EqualOdds, GivenOdds, Standing
from dicedesign.errors import InputError


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: EqualOdds(1), "equal: expected a number of poses from 2"),
        (lambda: Standing(), "stand: expected the number of a pose or the direction .* neither"),
        (lambda: Standing(1, (0.0, 0.0, 1.0)), "got both"),
        (lambda: Standing(pose=0), "1 for the most probable, got 0"),
        (lambda: Standing(down=(0.0, 0.0, 0.0)), "other than 0,0,0"),
        (lambda: Standing(down=(0.0, float("nan"), 1.0)), "stand: expected a direction"),
        (lambda: GivenOdds((0.5, 0.6)), "a sum of at most 1, got 0.5, 0.6 with a sum of 1.1"),
        (lambda: GivenOdds((0.5, -0.1)), "above 0"),
        (lambda: GivenOdds(()), "from 1 to 100 probabilities"),
        (lambda: GivenOdds((float("nan"),)), "from 1 to 100 probabilities"),
        (lambda: GivenOdds((0.5, 0.2), (1,)), "poses: expected 2 numbers of poses"),
        (lambda: GivenOdds((0.5, 0.2), (1, 1)), "each once"),
        (lambda: GivenOdds((0.5, 0.2), (0, 1)), "1 for the most probable"),
    ],
)
def test_goals_that_are_refused(make: Callable[[], object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()
