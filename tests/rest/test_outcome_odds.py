"""Odds of clusters of rests, on bodies whose odds are known."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import CORNERS, NORMALS
from numpy.typing import NDArray

from dicedesign import rest_poses
from dicedesign.rest.outcomes import outcome_odds

Floats = NDArray[np.float64]


def roof(degrees: float) -> Floats:
    """Corners of a cube whose lower side is bent: two rests so many degrees apart."""
    rise = np.tan(np.radians(degrees / 2.0))
    raised = CORNERS + np.array([0.0, 0.0, rise]) * (CORNERS[:, 2:] < 0.0)
    return np.concatenate([raised, [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0]]])


def test_a_cube_is_a_fair_die() -> None:
    found = outcome_odds(rest_poses(CORNERS), NORMALS)
    np.testing.assert_allclose(found.odds, 1.0 / 6.0, rtol=1e-12)
    assert found.elsewhere == 0.0
    np.testing.assert_array_equal(found.rest_counts, np.ones(6))
    assert found.error(np.full(6, 1.0 / 6.0)) < 1e-12
    assert found.error(np.array([0.1, 0.2, 0.2, 0.2, 0.15, 0.15])) == pytest.approx(1.0 / 15.0)


def test_odds_elsewhere_count_as_error() -> None:
    poses = rest_poses(CORNERS * np.array([1.0, 0.9, 0.7]))
    upright = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    found = outcome_odds(poses, upright)
    expected = [poses.probabilities[np.argmax(poses.normals @ way)] for way in upright]
    np.testing.assert_allclose(found.odds, expected, rtol=1e-12)
    assert found.elsewhere == pytest.approx(1.0 - sum(expected))
    assert found.error(found.odds) == found.elsewhere
    assert (found.outcome_of_rest == -1).sum() == 4


@pytest.mark.parametrize(("degrees", "together"), [(3.0, True), (4.99, True), (5.01, False)])
def test_rests_within_five_degrees_are_one_outcome(degrees: float, together: bool) -> None:
    body = roof(degrees)
    poses = rest_poses(body, center_of_mass=np.zeros(3))
    below = poses.normals[:, 2] < -0.5
    assert below.sum() == 2
    directions = NORMALS.copy()
    # The main rest is one of the two, though the direction is that between them or beyond.
    directions[5] = [0.01, 0.0, -1.0] / np.hypot(0.01, 1.0)
    found = outcome_odds(poses, directions)
    both = float(poses.probabilities[below].sum())
    assert found.rest_counts[5] == (2 if together else 1)
    assert found.odds[5] == pytest.approx(both if together else both / 2.0, rel=1e-9)
    assert found.elsewhere == pytest.approx(0.0 if together else both / 2.0, abs=1e-12)
    assert found.odds.sum() + found.elsewhere == pytest.approx(1.0, rel=1e-12)


def test_an_outcome_without_a_rest_near_it_counts_the_nearest() -> None:
    away = np.array([[0.3, 0.1, 1.0]]) / np.sqrt(1.1)
    found = outcome_odds(rest_poses(CORNERS), away)
    np.testing.assert_allclose(found.odds, [1.0 / 6.0], rtol=1e-12)
    assert found.elsewhere == pytest.approx(5.0 / 6.0)
