"""What is predicted of a die, and checks of tables."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only
from common.paths import public_data
from common.thrown import box, thrown
from scipy import stats
from scipy.special import xlogy

from dicedesign.throws.goodness_of_fit import chi_square, two_sample_chi_square
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_fit import SERIES, check_table, expected_deviations, predicted
from dicedesign.throws.tables import Table, table_named
from dicedesign.throws.throw_counts import CountedDie, read_throw_counts


def test_one_parameter_on_which_two_odds_depend() -> None:
    """Normal to a good approximation: precisions add up."""
    value = np.random.default_rng(0).normal(0.5, 0.02, 100_000)
    odds = np.stack([value, 1.0 - value], axis=1)
    found = expected_deviations(value[:, None], odds, [100, 1000])
    for count, left in zip((100, 1000), found[:, 0], strict=True):
        assert left == pytest.approx((1.0 / 0.02**2 + count / 0.25) ** -0.5, rel=0.01)


def test_by_odds_that_are_known_it_is_the_likelihood_ratio_test() -> None:
    """Against all possible counts."""
    throws, p = 30, 0.3
    every = np.arange(throws + 1)
    counts = np.stack([every, throws - every], axis=1)
    ratio = 2.0 * (xlogy(counts, counts / throws) - counts * np.log([p, 1.0 - p])).sum(axis=1)
    for came in (4, 9, 15):
        exact = stats.binom.pmf(every[ratio >= ratio[came] - 1e-9], throws, p).sum()
        found = predicted(counts[came], np.array([[p, 1.0 - p]]), np.random.default_rng(came))
        assert found.p_value == pytest.approx(exact, abs=4.0 * found.standard_error + 1e-3)
        assert found.odds == pytest.approx([p, 1.0 - p])
        assert found.deviation == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_outcome_that_is_least_as_predicted() -> None:
    odds = np.tile([0.1, 0.3, 0.6], (50, 1))
    found = predicted(np.array([60, 90, 150]), odds, np.random.default_rng(4))
    assert found.worst == 0
    low, high = found.interval
    assert [low, high] == pytest.approx(stats.binom.ppf([0.025, 0.975], 300, 0.1), abs=1)
    assert found.p_value == pytest.approx(1.0 / (SERIES + 1))


DEAD = Table("dead", 0.0, 0.5, 0.03, 0.0, 0.0)


@compiled_only
def test_a_die_thrown_on_the_same_table() -> None:
    """Sides of a box that was dropped without a bounce, and one that nobody counts."""
    body, poses = thrown(box(1.0, 1.2, 1.4))
    sides = np.abs(poses.normals).argmax(axis=1)
    groups = np.where(poses.normals[:, 2] > 0.5, -1, sides)
    seen = simulate(body, DEAD, 600, seed=1).counts
    real = np.array([seen[groups == side].sum() for side in range(3)])
    odds = np.array([0.1, 0.2, 0.7])
    die = CountedDie("box", body, 0.03, ("x", "y", "z"), real, odds, groups, poses)
    told: list[int] = []
    (check,) = check_table([die], DEAD, 700, 2, progress=told.append)
    assert sum(told) == 700
    assert check.unresolved == 0
    same = simulate(body, Table("dead", 0.0, 0.5, 0.03, 0.0, 0.0, size=0.03), 700, seed=2).counts
    wanted = [same[groups == side].sum() for side in range(3)]
    assert check.simulated.tolist() == wanted
    assert check.odds.sum() == pytest.approx(1.0)
    assert check.chi_square == two_sample_chi_square(real, wanted)
    assert check.chi_square.p_value > 0.01
    assert check.exact.p_value > 0.005
    assert check.geometric == chi_square(real, [0.1, 0.2, 0.7])
    assert check.geometric.p_value < 1e-9


@compiled_only
def test_no_published_die_rejects_the_board_game() -> None:
    """While two reject the odds without momentum. Of four dice one has p below 0.05 on many a
    seed, without being rejected."""
    throws = public_data("published/throws.csv")
    names = ["binomial2", "binomial3", "binomial4", "2d6_hendecahedron"]
    checks = check_table(read_throw_counts(throws, names), table_named("board-game"), 4000, 12)
    assert all(check.chi_square.p_value > 0.01 for check in checks)
    assert [check.geometric.p_value > 0.01 for check in checks] == [True, True, False, False]
