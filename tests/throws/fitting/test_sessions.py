"""Hands that differ between sessions, and dice of any size as ones of one size."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import random_body
from scipy import stats

from dicedesign.throws.sessions import (
    BETWEEN,
    LOWEST,
    PARAMETERS,
    SIMULATED,
    SIZE,
    SIZES,
    WITHIN,
    drawn_values,
    session_offsets,
    session_points,
    shared_values,
    simulated_table,
)
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table

START = Table("mine", 0.0, 0.0, 0.0, 0.0, 0.0, source="counts")

MIDDLE = np.full((1, 5), 0.5)


def values_of(points: np.ndarray) -> np.ndarray:
    """Of simulated sets."""
    least, most = np.array(list(SIMULATED.values())).T
    hand = least[2:] * (most[2:] / least[2:]) ** points[..., 2:]
    return np.concatenate([least[:2] + (most - least)[:2] * points[..., :2], hand], axis=-1)


def test_the_prior_is_flat_in_logarithms_of_the_hand() -> None:
    least, most = np.array(list(PARAMETERS.values())).T
    assert shared_values(np.zeros((1, 5)))[0] == pytest.approx(least)
    assert shared_values(np.ones((1, 5)))[0] == pytest.approx(most)
    middle = [*(least + most)[:2] / 2.0, *np.sqrt(least * most)[2:]]
    assert shared_values(MIDDLE)[0] == pytest.approx(middle)


def test_sessions_are_spread_about_the_center() -> None:
    offsets = session_offsets(1024, np.random.default_rng(0))
    for column in offsets[:, :3].T:
        assert stats.kstest(column / BETWEEN, "norm").pvalue > 0.5
    assert stats.kstest(offsets[:, 3], "uniform").pvalue > 0.5
    assert np.abs(np.corrcoef(offsets.T) - np.eye(4)).max() < 0.05


def test_a_session_of_a_die_of_known_size() -> None:
    """Height in sizes, speed in roots of gravity times size, and spin in their inverse."""
    offsets = np.array([[0.2, -0.1, 0.3, 0.9], [0.0, 0.0, 0.0, 0.1]])
    shared = shared_values(MIDDLE)[0]
    for size in (SIZE, 0.03):
        found = values_of(session_points(MIDDLE, offsets, size))[0]
        assert found[:, :2] == pytest.approx(np.array([shared[:2], shared[:2]]))
        height, speed, spin = (found[:, 2:] / np.exp(offsets[:, :3])).T
        assert height / SIZE == pytest.approx(np.full(2, shared[2] / size))
        assert speed / SIZE**0.5 == pytest.approx(np.full(2, shared[3] / size**0.5))
        assert spin * SIZE**0.5 == pytest.approx(np.full(2, shared[4] * size**0.5))


def test_a_session_of_a_die_of_unknown_size() -> None:
    offsets = np.array([[0.1, 0.1, 0.1, 0.0], [0.1, 0.1, 0.1, 1.0]])
    found = session_points(MIDDLE, offsets, None)[0]
    for i, size in enumerate(SIZES):
        assert found[i] == pytest.approx(session_points(MIDDLE, offsets, size)[0, i])


def test_hands_beyond_the_limits_count_as_at_them() -> None:
    offsets = np.array([[9.0, -9.0, 9.0, 0.5]])
    assert session_points(MIDDLE, offsets, SIZE)[0, 0, 2:].tolist() == [1.0, 0.0, 1.0]
    lowest = drawn_values(MIDDLE, -offsets)
    assert lowest[0, 2] == LOWEST


def test_the_table_of_a_set_has_its_throws_about_the_session() -> None:
    for point in (np.zeros(5), np.full(5, 0.4), np.ones(5)):
        table, values = simulated_table(START, point), values_of(point)
        assert (table.name, table.source, table.size) == ("mine", "counts", SIZE)
        assert [table.restitution, table.friction] == pytest.approx(values[:2], rel=0.006)
        ranges = np.array([table.height, table.speed, table.spin])
        assert ranges.mean(axis=1) == pytest.approx(values[2:], rel=0.006)
        wide = (ranges[:, 1] - ranges[:, 0]) / ranges.sum(axis=1)
        assert wide == pytest.approx(np.full(3, WITHIN), abs=0.01)


@compiled_only
def test_a_larger_die_does_the_same_when_it_is_thrown_as_much_more() -> None:
    """To the last bit, as a factor of four in length is one of two in time and speed."""
    body, _ = random_body(2)
    table = Table("small", 0.5, 0.4, (0.03, 0.1), (0.1, 0.4), (10.0, 40.0), size=0.025)
    large = Table("large", 0.5, 0.4, (0.12, 0.4), (0.2, 0.8), (5.0, 20.0), size=0.1)
    both = [simulate(body, sized, 200, seed=3).outcomes.tolist() for sized in (table, large)]
    assert both[0] == both[1]
