"""Odds of clusters of rests, on bodies whose odds are known."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import CORNERS, NORMALS
from numpy.typing import NDArray

from dicedesign import rest_poses
from dicedesign.rest.outcomes import gathered, outcome_margins, outcome_odds

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


def test_margins_are_the_angles_at_which_a_box_tips() -> None:
    """Over its nearer edge onto another outcome, or onto none; not onto a side of its own."""
    half = np.array([1.0, 0.9, 0.7])
    poses = rest_poses(CORNERS * half)
    upright = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    margins = outcome_margins(poses, outcome_odds(poses, upright))
    np.testing.assert_allclose(margins, np.arctan([0.9 / 0.7, 0.9 / 0.7, 0.7 / 1.0]), rtol=1e-12)
    split = rest_poses(roof(3.0))
    below = np.array([[0.0, 0.0, -1.0]])
    assert outcome_margins(split, outcome_odds(split, below))[0] > 0.7


def test_the_least_angle_is_between_two_outcomes() -> None:
    poses = rest_poses(roof(20.0))
    below = poses.normals[poses.normals[:, 2] < -0.5]
    assert outcome_odds(poses, below).least_angle == pytest.approx(np.radians(20.0), rel=1e-12)
    assert outcome_odds(poses, below[:1]).least_angle == np.pi


def test_without_a_rest_nothing_is_shown() -> None:
    found = gathered(NORMALS[:1], np.array([1.0]), NORMALS[:2])
    assert found.odds.tolist() == [1.0, 0.0]
    assert found.main.tolist() == [0, -1]
    assert found.rest_counts.tolist() == [1, 0]
    assert found.rest_counts.dtype.kind == "i"


def test_an_outcome_without_a_rest_near_it_counts_the_nearest() -> None:
    away = np.array([[0.3, 0.1, 1.0]]) / np.sqrt(1.1)
    found = outcome_odds(rest_poses(CORNERS), away)
    np.testing.assert_allclose(found.odds, [1.0 / 6.0], rtol=1e-12)
    assert found.elsewhere == pytest.approx(5.0 / 6.0)


def test_an_outcome_has_no_rest_that_is_nearer_to_another() -> None:
    """However far the rest is that is nearest to it."""
    angles = np.radians([[0.0, 20.0], [150.0, 20.0]])
    directions, normals = np.stack([0.0 * angles, np.sin(angles), np.cos(angles)], axis=-1)
    normals[0, 1] *= -1.0
    found = gathered(normals, np.array([0.1, 0.9]), directions)
    assert found.main.tolist() == [0, 1]
    np.testing.assert_array_equal(found.odds, [0.1, 0.9])
    assert found.elsewhere == 0.0
