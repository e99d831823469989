"""Dice on many tables, whose odds on each are known."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.throws.bias import Series, variations_on_tables

TARGET = np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1]) / 36.0
MEASURES = np.random.default_rng(1).normal(size=(32, 3))
TILT = 0.05 * np.random.default_rng(2).normal(size=(3, 11))


def tilted(odds: np.ndarray, logarithms: np.ndarray) -> np.ndarray:
    found = odds * np.exp(logarithms)
    return found / found.sum()


def judged(change: float, known: float, drops: int, seed: int) -> tuple[np.ndarray, object]:
    """True total variations on the tables, and what throws say, of a die whose odds change so much
    with the table, of which a model knows a part."""
    rng = np.random.default_rng(seed)
    true = [tilted(TARGET, change * row @ TILT) for row in MEASURES]
    others = [
        Series(tilted(TARGET, known * change * row @ TILT), rng.multinomial(drops, odds))
        for row, odds in zip(MEASURES, true, strict=True)
    ]
    meant = Series(TARGET, rng.multinomial(20 * drops, TARGET))
    found = variations_on_tables(TARGET, MEASURES, others, meant)
    return np.array([0.5 * np.abs(odds - TARGET).sum() for odds in true]), found


@pytest.mark.parametrize("known", [0.0, 0.7])
def test_few_throws_onto_each_table_tell_what_the_die_does_on_all(known: float) -> None:
    true, found = judged(1.0, known, 1000, 3)
    # A thousand throws onto one table alone show three times as much of chance.
    assert np.abs(np.array(found.values) - true).max() < 0.015
    assert found.often == pytest.approx(np.quantile(true, 0.9), abs=0.008)
    assert found.worst == pytest.approx(true.max(), abs=0.01)
    assert found.often > 2.0 * found.chance_often


def test_a_perfect_die_shows_chance() -> None:
    found = [judged(0.0, 1.0, 500, seed)[1] for seed in range(5)]
    mean = np.mean([one.often for one in found])
    assert mean == pytest.approx(np.mean([one.chance_often for one in found]), rel=0.3)
    assert all(one.chance_worst >= one.chance_often > 0.0 for one in found)
