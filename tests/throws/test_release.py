"""The paper's directions, and how bodies are let go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.thrown import BOARD, random_body
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from dicedesign.throws.rigid_body import (
    PAPER_DIRECTIONS,
    Orientations,
    RigidBody,
    released,
    released_on,
    up_directions,
)
from dicedesign.throws.tables import Table, table_named


def turns(states: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) from principal axes to the world."""
    return Rotation.from_quat(np.roll(states[:, 3:7], -1, axis=1)).as_matrix()


def test_the_paper_has_1212_directions() -> None:
    directions, areas = up_directions()
    assert directions.shape == (PAPER_DIRECTIONS, 3) == (1212, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-14)
    assert areas.sum() == pytest.approx(1.0)
    # Those of the icosahedron's corners have five neighbours and are the smallest.
    assert np.count_nonzero(areas < 1.01 * areas.min()) == 12
    assert areas.max() < 2.0 * areas.min()
    # Neighbours are nearly as far apart as on a regular grid of as many points.
    cosines = directions @ directions.T - 2.0 * np.eye(PAPER_DIRECTIONS)
    nearest = np.arccos(cosines.max(axis=1))
    assert 0.75 < nearest.min() / np.sqrt(8 * np.pi / np.sqrt(3) / PAPER_DIRECTIONS) <= 1.0


@pytest.mark.parametrize("orientations", ["uniform", "icosahedron"])
@pytest.mark.parametrize("how", [BOARD, table_named("carpet")])
def test_bodies_are_let_go_above_the_table(orientations: Orientations, how: Table) -> None:
    body = random_body(2)[0]
    states = released(body, how, np.arange(400), orientations, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(states[:, 3:7], axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(states[:, 7:10], axis=1), how.speed)
    np.testing.assert_array_equal(states[:, 9], 0.0)
    np.testing.assert_allclose(np.linalg.norm(states[:, 10:], axis=1), how.spin)
    heights = turns(states)[:, 2] @ body.vertices.T * how.size / 2.0 + states[:, 2:3]
    np.testing.assert_allclose(heights.min(axis=1), how.height, atol=1e-15)


SPREAD = replace(BOARD, height=(0.05, 0.2), speed=(0.0, 0.6), spin=(5.0, 25.0))


def manners(states: np.ndarray, body: RigidBody) -> np.ndarray:
    """Heights of the lowest points, speeds and spins, (3, n)."""
    lowest = (turns(states)[:, 2] @ body.vertices.T).min(axis=1) * BOARD.size / 2.0
    speed, spin = (
        np.linalg.norm(states[:, part], axis=1) for part in (slice(7, 10), slice(10, 13))
    )
    return np.stack([states[:, 2] + lowest, speed, spin])


@pytest.mark.parametrize("aimed", [False, True])
def test_ranges_are_drawn_evenly_and_independently(aimed: bool) -> None:
    body, count = random_body(2)[0], 4000
    rng = np.random.default_rng(5)
    if aimed:
        states = released_on(body, SPREAD, count, np.array([0.0, 0.0, 1.0]), rng)
    else:
        states = released(body, SPREAD, np.arange(count), "uniform", rng)
    found = manners(states, body)
    for values, (low, high) in zip(found, (SPREAD.height, SPREAD.speed, SPREAD.spin), strict=True):
        assert kstest(values, "uniform", (low, high - low)).pvalue > 1e-3
    # Nor do they tell how it is turned.
    known = np.concatenate([found, states[:, 3:7].T])
    correlations = np.corrcoef(known) - np.eye(len(known))
    assert np.abs(correlations[:3]).max() < 4.0 / np.sqrt(count)


def test_orientations_are_uniform() -> None:
    """Rotation matrices have mean 0, and each entry the variance 1/3."""
    body = random_body(2)[0]
    states = released(body, BOARD, np.arange(20_000), "uniform", np.random.default_rng(0))
    found = turns(states)
    assert np.abs(found.mean(axis=0)).max() < 4.0 * np.sqrt(1.0 / 3.0 / 20_000)
    np.testing.assert_allclose((found**2).mean(axis=0), 1.0 / 3.0, atol=0.01)
