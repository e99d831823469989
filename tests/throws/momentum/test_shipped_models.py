"""The momentum models of the package, against throws of a die that none was fitted to."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only

from benchmarks.training.random_dice import RandomDie, random_die
from dicedesign.throws.distances import total_variation
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.momentum_odds import momentum_odds
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_terms import CHANGES
from dicedesign.throws.tables import TABLE_NAMES, posterior_tables, table_named

pytestmark = compiled_only


@pytest.fixture(scope="module")
def dice() -> list[RandomDie]:
    """The models are made of dice of seed 0."""
    return [random_die(number, 1, (7, 13)) for number in range(4, 10)]


@pytest.mark.parametrize("name", [name for name in TABLE_NAMES if name != "carpet"])
def test_odds_are_nearer_to_throws_than_those_without_momentum(
    dice: list[RandomDie], name: str
) -> None:
    apart = []
    for die in dice:
        throws = simulate(die.body, table_named(name), 1000, 3)
        frequencies = throws.counts / throws.counts.sum()
        found = momentum_odds(die.poses, die.body, momentum_model(name))
        apart.append(
            [total_variation(frequencies, odds) for odds in (die.poses.probabilities, found)]
        )
    geometric, momentum = np.mean(apart, axis=0)
    assert geometric > 0.1
    # The model of paper, whose drops are least like the others', is the least of them.
    assert momentum < (0.85 if name == "paper" else 0.45) * geometric


def test_the_model_knows_what_a_livelier_table_does(dice: list[RandomDie]) -> None:
    table, model = table_named("board-game"), momentum_model("board-game")
    assert model is not None
    seen, expected = [], []
    for die in dice:
        livelier = [table.livelier(change) for change in CHANGES]
        throws = [simulate(die.body, one, 2000, 5) for one in livelier]
        up, down = (one.counts / one.counts.sum() for one in throws)
        seen.append(up - down)
        up, down = (momentum_odds(die.poses, die.body, model.on(one)) for one in livelier)
        expected.append(up - down)
    assert np.corrcoef(np.concatenate(seen), np.concatenate(expected))[0, 1] > 0.5


def test_the_model_knows_all_that_the_table_may_be_instead(dice: list[RandomDie]) -> None:
    model, posterior = momentum_model("board-game"), posterior_tables("board-game")
    assert model is not None
    assert len(posterior) > 10
    spreads = []
    for die in dice:
        odds = [momentum_odds(die.poses, die.body, model.on(table)) for table in posterior]
        np.testing.assert_allclose(np.sum(odds, axis=1), 1.0, atol=1e-9)
        spreads.append(np.std(odds, axis=0).max())
    assert max(spreads) > 0.005
