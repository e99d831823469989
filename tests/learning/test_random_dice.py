"""Random dice: kinds, limits, the same die for the same number."""

from __future__ import annotations

from collections import Counter
from itertools import count

import numpy as np
import pytest

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.learning.random_dice import (
    ACCURACY,
    DESIGNED,
    DICE_KINDS,
    LEAST_ODDS,
    RESTS,
    RandomDie,
    random_die,
)
from dicedesign.learning.random_polyhedra import KINDS, random_shape
from dicedesign.optimize.solvers import exact_search

SEED = 3


@pytest.fixture(scope="module")
def dice() -> list[RandomDie]:
    return [random_die(number, SEED) for number in range(80)]


def test_dice_are_within_limits_and_in_general_position(dice: list[RandomDie]) -> None:
    for die in dice:
        poses = die.poses
        assert die.kind in DICE_KINDS
        assert RESTS[0] <= len(poses.facets) <= RESTS[1]
        assert (len(poses.basins), poses.notes) == (1, ())
        assert poses.probabilities.sum() == pytest.approx(1.0)
        np.testing.assert_allclose(
            die.body.rest_normals @ die.body.axes.T, poses.normals, atol=1e-12
        )


def test_a_part_is_designed_and_a_part_off_center(dice: list[RandomDie]) -> None:
    kinds = Counter(die.kind for die in dice)
    assert len(kinds) >= 7
    designed = [die for die in dice if die.kind.startswith("designed")]
    # Within four standard deviations.
    assert abs(len(designed) / len(dice) - DESIGNED) < 0.2
    for die in designed:
        assert die.poses.probabilities.min() > LEAST_ODDS / 2.0
        assert die.poses.center_of_mass_source == "uniform solid hull"
    off = [die.poses for die in dice if die.poses.center_of_mass_source == "given"]
    assert 0 < len(off) < len(dice) // 4
    for poses in off:
        assert np.linalg.norm(poses.center_of_mass - poses.hull.centroid) > 0.0


def test_symmetric_dice_have_equal_odds(dice: list[RandomDie]) -> None:
    symmetric = [die for die in dice if die.kind == "designed with symmetry"]
    assert symmetric
    for die in symmetric:
        odds = die.poses.probabilities
        apart = np.abs(odds[:, None] - odds) + np.eye(len(odds))
        # All but the odds of a facet on the axis come at least twice.
        assert np.count_nonzero(apart.min(axis=1) > ACCURACY) <= 1


def test_the_number_and_the_seed_make_the_die(dice: list[RandomDie]) -> None:
    again = random_die(5, SEED)
    np.testing.assert_array_equal(again.poses.hull.vertices, dice[5].poses.hull.vertices)
    for other in (random_die(6, SEED), random_die(5, SEED + 1)):
        assert other.poses.hull.vertices.shape != again.poses.hull.vertices.shape or not (
            np.allclose(other.poses.hull.vertices, again.poses.hull.vertices)
        )


def test_no_die_depends_on_the_clock(
    dice: list[RandomDie], monkeypatch: pytest.MonkeyPatch
) -> None:
    number = next(n for n, die in enumerate(dice) if die.kind == "designed")
    hours = count(step=3600.0)
    monkeypatch.setattr(exact_search.time, "perf_counter", lambda: next(hours))
    slow = random_die(number, SEED)
    np.testing.assert_array_equal(slow.poses.hull.vertices, dice[number].poses.hull.vertices)


def test_other_limits() -> None:
    for number in range(12):
        assert 7 <= len(random_die(number, SEED, (7, 9)).poses.facets) <= 9


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_bounds_a_solid(kind: str) -> None:
    rng = np.random.default_rng(1)
    made = 0
    for _ in range(20):
        try:
            hull = convex_hull(KINDS[kind][1](rng))
        except DegenerateBodyError:
            continue
        made += 1
        assert hull.heights(hull.centroid).min() > 0.0
    assert made >= 15


def test_kinds_come_as_often_as_they_are_said_to() -> None:
    rng = np.random.default_rng(2)
    drawn: Counter[str] = Counter()
    while drawn.total() < 400:
        try:
            drawn[random_shape(rng)[0]] += 1
        except DegenerateBodyError:
            continue
    for kind, (part, _) in KINDS.items():
        assert drawn[kind] / 400.0 == pytest.approx(part, abs=0.11)
