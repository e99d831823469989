"""The paper's directions, drops from them, and distances between distributions of rests."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import random_body

from benchmarks.figure_10 import throw_shape, up_directions, wasserstein_distance
from dicedesign.throws.engines import NATIVE
from dicedesign.throws.tables import load_table


def test_the_paper_has_1212_directions() -> None:
    directions, areas = up_directions()
    assert directions.shape == (1212, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-14)
    assert areas.sum() == pytest.approx(4.0 * np.pi)
    # The cells of the icosahedron's corners have five neighbors and are the smallest.
    assert np.count_nonzero(areas < 1.01 * areas.min()) == 12
    # Neighbors are nearly as far apart as on a regular grid of as many points.
    nearest = np.arccos((directions @ directions.T - 2.0 * np.eye(1212)).max(axis=1))
    assert 0.75 < nearest.min() / np.sqrt(8 * np.pi / np.sqrt(3) / 1212) <= 1.0


@compiled_only
def test_drops_from_a_grid_scatter_less_than_random_ones() -> None:
    body, poses = random_body(1)
    rng = np.random.default_rng(0)
    frequencies, _ = throw_shape(body, load_table("carpet"), NATIVE, 0, rng)
    errors = frequencies - poses.probabilities
    chance = np.sqrt(poses.probabilities * (1.0 - poses.probabilities) / 1212)
    assert np.sqrt((errors**2).mean()) < 0.7 * np.sqrt((chance**2).mean())


def test_between_two_rests_the_distance_is_their_angle_times_the_total_variation() -> None:
    pytest.importorskip("ot")
    normals, first, second = np.eye(3)[:2], np.array([60.0, 40.0]), np.array([0.5, 0.5])
    assert wasserstein_distance(normals, first, second) == pytest.approx(0.1 * np.pi / 2)
