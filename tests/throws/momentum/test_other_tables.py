"""Tables that stand for what a table may be instead."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from dicedesign.throws.table_terms import GENERAL, MOST_OTHERS, dimensionless, other_tables, scaled
from dicedesign.throws.tables import Table

TABLE = Table("mine", 0.5, 0.5, 0.2, 0.5, 20.0)


def test_without_a_posterior_they_are_livelier_and_duller() -> None:
    assert [one.restitution for one in other_tables(TABLE)] == pytest.approx([0.6, 0.4])
    assert other_tables(replace(TABLE, restitution=0.0)) == ()


def test_few_of_a_posterior_are_near_all_the_others() -> None:
    """Nearly as near as the best choice of all."""
    rng = np.random.default_rng(0)
    posterior = [GENERAL.drawn(TABLE, rng) for _ in range(12)]
    numbers = np.array([scaled(dimensionless(one)) for one in posterior])
    numbers /= numbers.std(axis=0)
    apart = np.linalg.norm(numbers[:, None] - numbers, axis=2)

    def distance(chosen: tuple[int, ...]) -> float:
        return float(apart[list(chosen)].min(axis=0).sum())

    found = other_tables(TABLE, posterior)
    best = min(distance(chosen) for chosen in combinations(range(12), MOST_OTHERS))
    assert distance(tuple(posterior.index(one) for one in found)) < 1.15 * best
    assert other_tables(TABLE, posterior[:2]) in (tuple(posterior[:2]), tuple(posterior[1::-1]))


def test_tables_that_are_the_same_are_no_trouble() -> None:
    assert other_tables(TABLE, [TABLE] * 6) == (TABLE,) * MOST_OTHERS
