"""Tables against what came up with real dice."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only
from common.paths import public_data
from common.thrown import box, thrown

from dicedesign.throws.goodness_of_fit import chi_square, two_sample_chi_square
from dicedesign.throws.predictions import check_table
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, table_named
from dicedesign.throws.throw_counts import CountedDie, read_throw_counts

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
def test_a_die_larger_than_the_drop_height_is_let_go_from_higher() -> None:
    """As one of 40 mm on a table that was fitted to dice of 25 mm."""
    body, poses = thrown(box(1.0, 1.2, 1.4))
    sides = np.abs(poses.normals).argmax(axis=1)
    even = np.full(3, 1.0 / 3.0)
    die = CountedDie("box", body, 0.04, ("x", "y", "z"), np.array([3, 2, 1]), even, sides, poses)
    low = Table("low", 0.3, 0.5, (0.03, 0.09), 0.0, 0.0)
    (check,) = check_table([die], low, 300, 2)
    higher = Table("low", 0.3, 0.5, (0.04, 0.09), 0.0, 0.0, size=0.04)
    wanted = die.by_outcome(simulate(body, higher, 300, seed=2).counts)
    assert check.simulated.tolist() == wanted.tolist()


@compiled_only
def test_no_published_die_rejects_the_board_game() -> None:
    """While two reject the odds without momentum. Of four dice one has p below 0.05 on many a
    seed, without being rejected."""
    throws = public_data("published/throws.csv")
    names = ["binomial2", "binomial3", "binomial4", "2d6_hendecahedron"]
    checks = check_table(read_throw_counts(throws, names), table_named("board-game"), 4000, 12)
    assert all(check.chi_square.p_value > 0.01 for check in checks)
    assert [check.geometric.p_value > 0.01 for check in checks] == [True, True, False, False]
