"""What throws tell about a table, against odds whose information is known."""

from __future__ import annotations

import numpy as np
import pytest
from common.thrown import box, thrown

from dicedesign.throws import table_information as subject
from dicedesign.throws.table_information import BLOCKS, HAND, TableInformation, table_information
from dicedesign.throws.tables import Table

TABLE = Table("made up", 0.5, 0.6, (0.1, 0.2), 0.5, 20.0)

CENTER = np.array([0.5, 0.3, 0.2])

SLOPES = np.array(
    [
        [0.6, -0.4, -0.2],
        [0.0, 0.3, -0.3],
        [0.1, -0.1, 0.0],
        [0.0, 0.05, -0.05],
        [-0.05, 0.0, 0.05],
    ]
)
"""Of the odds of three outcomes, in restitution, friction and the logarithms of a hand."""


def linear_odds(slopes: np.ndarray, rng: np.random.Generator) -> object:
    """Throws whose odds are linear functions; every tenth comes to no rest."""

    def throw_states(body: object, table: Table, states: np.ndarray) -> np.ndarray:
        assert isinstance(table.height, tuple)
        assert isinstance(table.speed, float)
        assert isinstance(table.spin, float)
        hand = np.log([table.height[1] / 0.2, table.speed / 0.5, table.spin / 20.0])
        assert (np.abs(hand) <= np.log(HAND) + 1e-9).all()
        causes = [table.restitution - 0.5, table.friction - 0.6, *hand]
        rests = rng.choice(3, len(states), p=CENTER + causes @ slopes)
        return np.where(np.arange(len(states)) % 10, rests, -1)

    return throw_states


def test_the_information_of_linear_odds(monkeypatch: pytest.MonkeyPatch) -> None:
    body, _ = thrown(box(1.0, 1.1, 1.2))
    monkeypatch.setattr(
        subject.native, "throw_states", linear_odds(SLOPES, np.random.default_rng(0))
    )
    ended: list[int] = []
    found = table_information(body, np.array([0, 1, 2]), TABLE, 200_000, 1, ended.append)
    assert sum(ended) >= 200_000
    expected = SLOPES / CENTER @ SLOPES.T
    # Of restitution and friction alone, and of all by their standard errors.
    np.testing.assert_allclose(found.matrix[:2, :2], expected[:2, :2], atol=0.08)
    told = found.errors(300)
    known = 300 * expected + np.diag([0.0, 0.0, *np.log(HAND) ** -2.0])
    covariance = np.linalg.inv(known)[:2, :2]
    for value, own, true in (
        (told.restitution, told.restitution_error, np.sqrt(covariance[0, 0])),
        (told.friction, told.friction_error, np.sqrt(covariance[1, 1])),
        (told.both, told.both_error, np.sqrt(np.linalg.det(covariance))),
    ):
        assert 0.0 < own < 0.1 * true
        assert abs(value - true) < 4.0 * own


def test_outcomes_that_are_not_told_apart_tell_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """And those that show nothing leave the odds among the others."""
    body, _ = thrown(box(1.0, 1.1, 1.2))
    for outcomes, odds, slopes in (
        ([0, 0, 1], [0.8, 0.2], np.column_stack([SLOPES[:, :2].sum(axis=1), SLOPES[:, 2]])),
        (
            [0, 1, -1],
            [0.625, 0.375],
            (SLOPES[:, :2] - [[0.625, 0.375]] * SLOPES[:, :2].sum(axis=1)[:, None]) / 0.8,
        ),
    ):
        monkeypatch.setattr(
            subject.native, "throw_states", linear_odds(SLOPES, np.random.default_rng(0))
        )
        found = table_information(body, np.array(outcomes), TABLE, 200_000, 1)
        expected = slopes / odds @ slopes.T
        np.testing.assert_allclose(found.matrix[:2, :2], expected[:2, :2], rtol=0.1, atol=0.02)


def test_odds_that_are_the_same_everywhere_tell_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    body, _ = thrown(box(1.0, 1.1, 1.2))
    monkeypatch.setattr(
        subject.native, "throw_states", linear_odds(0.0 * SLOPES, np.random.default_rng(0))
    )
    found = table_information(body, np.array([0, 1, 2]), TABLE, 50_000, 1)
    assert np.diag(found.matrix).max() < 0.02
    assert found.errors(300).both > 0.1


def test_what_cannot_be_told_apart() -> None:
    """Odds of one outcome against all others are one number, and restitution and friction are
    two."""
    slope = np.array([1.0, -0.5, 0.0, 0.0, 0.0])
    one = np.outer(slope, slope)
    told = TableInformation(one, np.array([one] * BLOCKS)).errors(1000)
    assert (told.restitution, told.friction, told.both) == (np.inf, np.inf, np.inf)
    assert np.isnan(told.both_error)


def test_four_times_the_throws_leave_half_open() -> None:
    alone = np.diag([1.0, 0.25, 0.0, 0.0, 0.0])
    information = TableInformation(alone, np.array([alone] * BLOCKS))
    few, many = information.errors(100), information.errors(400)
    assert (few.restitution, few.friction) == pytest.approx((0.1, 0.2))
    assert (many.restitution, many.friction) == pytest.approx((0.05, 0.1))
    assert few.both == pytest.approx(0.1 * 0.2)
    assert few.both_error == pytest.approx(0.0, abs=1e-12)
