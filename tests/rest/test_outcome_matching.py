"""Matching counted outcomes with rests."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.rest.outcomes import facet_of_rest, match_by_normals, match_by_odds, sums_by_outcome

AXES = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [-1.0, 0, 0]])


def test_outcomes_take_the_rests_of_their_rank() -> None:
    groups = match_by_odds("die", AXES, np.array([0.4, 0.3, 0.2, 0.1]), [0.101, 0.4, 0.199, 0.3])
    assert groups.members == ((1,), (3,), (2,), (0,))
    assert groups.group_of_rest.tolist() == [0, 1, 2, 3]


def test_equal_odds_are_one_group() -> None:
    groups = match_by_odds(
        "die", AXES, np.array([0.38, 0.36, 0.13, 0.13]), [0.13, 0.37, 0.37, 0.13]
    )
    assert groups.members == ((1, 2), (0, 3))
    assert groups.group_of_rest.tolist() == [0, 0, 1, 1]


def test_nearly_equal_odds_are_one_group_where_the_mesh_is_no_closer() -> None:
    """Odds 0.004 apart say nothing where the match is wrong by 0.005, and much by 0.001."""
    wanted = [0.45, 0.277, 0.273]
    near = match_by_odds("die", AXES[:3], np.array([0.4492, 0.2777, 0.2731]), wanted)
    far = match_by_odds("die", AXES[:3], np.array([0.445, 0.2782, 0.2768]), wanted)
    assert near.members == ((0,), (1,), (2,))
    assert far.members == ((0,), (1, 2))


def test_a_facet_in_two_is_one_outcome() -> None:
    normals = np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0.01, 0], [-1.0, -0.01, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    odds = np.array([0.26, 0.24, 0.255, 0.245])
    groups = match_by_odds("die", normals, odds, [0.25, 0.5, 0.25])
    assert groups.members == ((1,), (0, 2))
    assert groups.group_of_rest.tolist() == [1, 1, 0, 0]


def test_one_outcome_is_that_of_all_rests() -> None:
    groups = match_by_odds("die", AXES[:3], np.array([0.5, 0.3, 0.2]), [1.0])
    assert groups.members == ((0,),)
    assert groups.group_of_rest.tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("odds", "wanted", "message"),
    [
        ([0.5, 0.5], [0.5, 0.25, 0.25], "expected at least as many rests as outcomes, got 2 rests"),
        ([0.5, 0.3, 0.2], [0.5, 0.25, 0.25], "got 0.3000 for 0.2500"),
        ([0.5, 0.5], [0.5, 0.5], "expected outcomes that differ in their geometric odds"),
    ],
)
def test_dice_that_cannot_be_matched(odds: list[float], wanted: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        match_by_odds("die", AXES[: len(odds)], np.array(odds), wanted)


def test_by_normals() -> None:
    """Rests show what the facet within five degrees shows, and others nothing."""
    shown = AXES[[0, 1, 3]]
    tilted = np.array([np.cos(np.radians(4.0)), np.sin(np.radians(4.0)), 0.0])
    groups = match_by_normals(np.vstack([AXES, tilted]), shown, [0, 1, 0])
    assert groups.members == ((0,), (1,))
    assert groups.group_of_rest.tolist() == [0, 1, -1, 0, 0]


def test_without_a_facet_no_rest_is_on_one() -> None:
    assert facet_of_rest(AXES, np.empty((0, 3))).tolist() == [-1] * 4


def test_sums_leave_out_rests_that_show_nothing() -> None:
    outcomes = np.array([1, -1, 1, 0])
    assert sums_by_outcome(np.array([1, 2, 4, 8]), outcomes, 3).tolist() == [8, 5, 0]
    assert sums_by_outcome(np.array([0.5, 0.25, 0.125, 0.0]), outcomes, 2).tolist() == [0, 0.625]
