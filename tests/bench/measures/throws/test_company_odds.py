"""What company does to odds: against counts by hand, and chance by many made-up series."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from common.thrown import OCTAHEDRON, thrown
from scipy.stats import kstest

from dicedesign.bench.measures.throws.company_odds import (
    CompanyOdds,
    Pairs,
    compare,
    thrown_together,
)
from dicedesign.bench.measures.throws.meetings import Meeting
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.tables import Table

ODDS = np.array([0.1, 0.4, 0.3, 0.2])


def counted(rests: int = 4) -> CountedDie:
    """A die with the outcomes A, of rests 0 and 3, and B and C of one each."""
    body, poses = thrown(OCTAHEDRON)
    groups = np.resize([0, 1, 2, 0], rests)
    labels = ("A", "B", "C")
    return CountedDie("made up", body, 0.02, labels, np.ones(3, int), np.ones(3) / 3, groups, poses)


def series(rng: np.random.Generator, throws: int, touched: float, odds: Any) -> tuple[Any, Any]:
    """Pairs of which a part touched and had some odds then, and throws at a wall with the same."""
    met = rng.random(throws) < touched
    alone = rng.choice(4, (throws, 2), p=ODDS)
    rests = np.where(met[:, None], rng.choice(4, (throws, 2), p=odds), alone)
    wall = Meeting(rng.choice(4, (2 * throws, 1), p=odds), np.ones(2 * throws, bool))
    return Pairs(Meeting(rests, met), alone), wall


def test_by_hand() -> None:
    alone = np.array([[0, 1], [1, 2], [3, 1], [2, 2]])
    together = np.array([[0, 1], [-1, 2], [3, 0], [2, 2]])
    pairs = Pairs(Meeting(together, np.array([False, True, True, False])), alone)
    wall = Meeting(np.array([[0], [1], [-1], [-1]]), np.ones(4, bool))
    found = compare(counted(), [pairs], [wall])
    die = found["die"]
    # A, B, C of 8: 2, 3, 3 alone; of 7: 3, 1, 3 together.
    np.testing.assert_allclose(die.changes, [3 / 7 - 2 / 8, 1 / 7 - 3 / 8, 3 / 7 - 3 / 8])
    assert (die.throws, die.touched, die.lost, die.lost_alone) == (8, 0.5, 1 / 8, 0.0)
    assert die.total_variation == pytest.approx(3 / 8 - 1 / 7)
    at_wall = found["wall"]
    np.testing.assert_allclose(at_wall.changes, [1 / 2 - 2 / 8, 1 / 2 - 3 / 8, -3 / 8])
    assert (at_wall.throws, at_wall.touched, at_wall.lost) == (4, 1.0, 0.5)


def many(odds: Any) -> dict[str, list[CompanyOdds]]:
    rng = np.random.default_rng(7)
    found: dict[str, list[CompanyOdds]] = {"die": [], "wall": []}
    for _ in range(400):
        pairs, wall = series(rng, 300, 0.3, odds)
        for company, one in compare(counted(), [pairs], [wall]).items():
            found[company].append(one)
    return found


@pytest.mark.parametrize("company", ["die", "wall"])
def test_errors_are_those_of_many_series(company: str) -> None:
    """Also where a part of the dice alone is the same as in company."""
    found = many(ODDS)[company]
    changes = np.array([one.changes for one in found])
    errors = np.array([one.errors for one in found]).mean(axis=0)
    np.testing.assert_allclose(changes.std(axis=0), errors, rtol=0.12)
    assert np.abs(changes.mean(axis=0) / errors).max() < 4.0 / np.sqrt(400)
    floors = np.mean([one.noise_floor for one in found])
    assert np.mean([one.total_variation for one in found]) == pytest.approx(floors, rel=0.1)
    assert kstest([one.p_value for one in found], "uniform").pvalue > 1e-3


def test_what_company_changes_is_found() -> None:
    other = np.array([0.2, 0.2, 0.4, 0.2])
    found = many(other)
    for company, part in (("die", 0.3), ("wall", 1.0)):
        mean = np.mean([one.changes for one in found[company]], axis=0)
        np.testing.assert_allclose(mean, part * np.array([0.1, -0.2, 0.1]), atol=0.01)
        above = np.mean([one.above_noise for one in found[company]])
        assert above == pytest.approx(0.2 * part, rel=0.15)
        assert np.median([one.p_value for one in found[company]]) < 0.01


def test_throws_in_mujoco() -> None:
    pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")
    die = counted(8)
    table = Table("near", 0.3, 0.5, 0.03, 0.8, 20.0)
    pairs = thrown_together(die, table, 10, (0, 0, 0))
    untouched = ~pairs.meeting.touched
    assert 0 < untouched.sum() < 10
    np.testing.assert_array_equal(pairs.alone[untouched], pairs.meeting.rests[untouched])
    assert (pairs.alone != pairs.meeting.rests).any()
    again = thrown_together(die, table, 10, (0, 0, 0))
    np.testing.assert_array_equal(again.meeting.rests, pairs.meeting.rests)
