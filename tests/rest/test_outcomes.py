"""Probabilities of outcomes, on bodies whose probabilities are known."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import CORNERS, NORMALS, roof

from dicedesign import rest_poses
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.outcomes import (
    assign_rests,
    facet_of_rest,
    outcome_margins,
    outcome_probabilities,
)


def test_a_cube_is_a_fair_die() -> None:
    outcomes = outcome_probabilities(rest_poses(CORNERS), NORMALS)
    np.testing.assert_allclose(outcomes.probabilities, 1.0 / 6.0, rtol=1e-12)
    assert outcomes.elsewhere == 0.0
    np.testing.assert_array_equal(outcomes.rest_counts, np.ones(6))
    assert outcomes.error(np.full(6, 1.0 / 6.0)) < 1e-12
    assert outcomes.error(np.array([0.1, 0.2, 0.2, 0.2, 0.15, 0.15])) == pytest.approx(1.0 / 15.0)


def test_probabilities_elsewhere_count_as_error() -> None:
    poses = rest_poses(CORNERS * np.array([1.0, 0.9, 0.7]))
    upright = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    outcomes = outcome_probabilities(poses, upright)
    expected = [poses.probabilities[np.argmax(poses.normals @ way)] for way in upright]
    np.testing.assert_allclose(outcomes.probabilities, expected, rtol=1e-12)
    assert outcomes.elsewhere == pytest.approx(1.0 - sum(expected))
    assert outcomes.error(outcomes.probabilities) == outcomes.elsewhere
    assert (outcomes.outcome_of_rest == -1).sum() == 4


def test_rests_within_five_degrees_are_one_outcome() -> None:
    directions = NORMALS.copy()
    # The main rest is one of the two, though the direction is that between them or beyond.
    directions[5] = [0.01, 0.0, -1.0] / np.hypot(0.01, 1.0)
    for degrees, together in ((3.0, True), (4.99, True), (5.01, False)):
        poses = rest_poses(roof(degrees), center_of_mass=np.zeros(3))
        below = poses.normals[:, 2] < -0.5
        assert below.sum() == 2
        outcomes = outcome_probabilities(poses, directions)
        both = float(poses.probabilities[below].sum())
        got = both if together else both / 2.0
        assert outcomes.rest_counts[5] == (2 if together else 1)
        assert outcomes.probabilities[5] == pytest.approx(got, rel=1e-9)
        assert outcomes.elsewhere == pytest.approx(both - got, abs=1e-12)
        assert outcomes.probabilities.sum() + outcomes.elsewhere == pytest.approx(1.0, rel=1e-12)


def test_a_rest_at_the_limit_is_of_the_outcome() -> None:
    """So it may be the outcome's main rest, being more probable."""
    normals = np.array([[0.0, 0.0, -1.0], [0.08, 0.0, -1.0] / np.hypot(0.08, 1.0)])
    limit = float(angle_between(*normals))
    for angle, main, rests in ((limit, 1, 2), (np.nextafter(limit, 0.0), 0, 1)):
        outcomes = assign_rests(normals, np.array([0.3, 0.7]), normals[:1], within=angle)
        assert (outcomes.main.tolist(), outcomes.rest_counts.tolist()) == ([main], [rests])


def test_without_shown_facets_no_rest_has_one() -> None:
    normals = np.eye(3)
    assert facet_of_rest(normals, normals[:0]).tolist() == [-1, -1, -1]
    assert facet_of_rest(normals, normals[[2, 0]]).tolist() == [1, -1, 0]


def test_margins_are_the_angles_at_which_a_box_tips() -> None:
    """Over its nearer edge onto another outcome, or onto none; not onto a side of its own."""
    half = np.array([1.0, 0.9, 0.7])
    poses = rest_poses(CORNERS * half)
    upright = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    margins = outcome_margins(poses, outcome_probabilities(poses, upright))
    np.testing.assert_allclose(margins, np.arctan([0.9 / 0.7, 0.9 / 0.7, 0.7 / 1.0]), rtol=1e-12)
    split = rest_poses(roof(3.0))
    below = np.array([[0.0, 0.0, -1.0]])
    assert outcome_margins(split, outcome_probabilities(split, below))[0] > 0.7


def test_an_outcome_has_no_rest_that_is_nearer_to_another() -> None:
    """However far the rest is that is nearest to it."""
    angles = np.radians([[0.0, 20.0], [150.0, 20.0]])
    directions, normals = np.stack([0.0 * angles, np.sin(angles), np.cos(angles)], axis=-1)
    normals[0, 1] *= -1.0
    outcomes = assign_rests(normals, np.array([0.1, 0.9]), directions)
    assert outcomes.main.tolist() == [0, 1]
    np.testing.assert_array_equal(outcomes.probabilities, [0.1, 0.9])
    assert outcomes.elsewhere == 0.0
