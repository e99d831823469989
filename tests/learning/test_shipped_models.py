"""The momentum models of the package, against throws of a die that none was fitted to."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only

from dicedesign.learning.random_dice import RandomDie, random_die
from dicedesign.throws.momentum.momentum_model import momentum_model
from dicedesign.throws.momentum.momentum_odds import momentum_odds
from dicedesign.throws.momentum.other_tables import CHANGES
from dicedesign.throws.simulation.simulation import simulate
from dicedesign.throws.statistics.total_variation import total_variation
from dicedesign.throws.tables import TABLE_NAMES, table_named

pytestmark = compiled_only


@pytest.fixture(scope="module")
def die() -> RandomDie:
    """The models are made of dice of seed 0."""
    return random_die(7, 1, (7, 13))


@pytest.mark.parametrize("name", [name for name in TABLE_NAMES if name != "carpet"])
def test_odds_are_nearer_to_throws_than_those_without_momentum(die: RandomDie, name: str) -> None:
    throws = simulate(die.body, table_named(name), 2000, 3)
    frequencies = throws.counts / throws.counts.sum()
    found = momentum_odds(die.poses, die.body, momentum_model(name))
    geometric = total_variation(frequencies, die.poses.probabilities)
    assert geometric > 0.1
    # The model of paper, whose drops are least like the others', is the least of them.
    assert total_variation(frequencies, found) < (0.6 if name == "paper" else 0.4) * geometric


def test_the_model_knows_what_a_livelier_table_does(die: RandomDie) -> None:
    table, model = table_named("board-game"), momentum_model("board-game")
    assert model is not None
    seen, expected = [], []
    for change in CHANGES:
        throws = simulate(die.body, table.livelier(change), 4000, 5)
        seen.append(throws.counts / throws.counts.sum())
        expected.append(momentum_odds(die.poses, die.body, model.on(table.livelier(change))))
    sensitivity, error = seen[0] - seen[1], (seen[0] - seen[1]) - (expected[0] - expected[1])
    # By chance alone both would be 0.02.
    assert np.abs(sensitivity).sum() / 2.0 > 0.05
    assert np.abs(error).sum() / 2.0 < 0.6 * np.abs(sensitivity).sum() / 2.0
