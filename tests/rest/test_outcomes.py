"""Probabilities of outcomes, on bodies whose probabilities are known; and counted outcomes matched
with rests."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import CORNERS, NORMALS, roof

from dicedesign import rest_poses
from dicedesign.errors import InputError
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.rest.outcomes import (
    assign_rests,
    match_by_normals,
    match_by_probability,
    outcome_margins,
    outcome_probabilities,
)
from dicedesign.runtime.arrays import Floats


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


AXES = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [-1.0, 0, 0]])


BROKEN = np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0.01, 0], [-1.0, -0.01, 0]])
"""Directions of rests of which the last two are on one facet that broke."""


@pytest.mark.parametrize(
    ("normals", "probabilities", "wanted", "members", "group_of_rest"),
    [
        (AXES, [0.4, 0.3, 0.2, 0.1], [0.101, 0.4, 0.199, 0.3], [1, 3, 2, 0], [0, 1, 2, 3]),
        (AXES, [0.38, 0.36, 0.13, 0.13], [0.13, 0.37, 0.37, 0.13], [(1, 2), (0, 3)], [0, 0, 1, 1]),
        (BROKEN, [0.26, 0.24, 0.255, 0.245], [0.25, 0.5, 0.25], [1, (0, 2)], [1, 1, 0, 0]),
    ],
)
def test_outcomes_take_the_rests_of_their_rank(
    normals: Floats,
    probabilities: list[float],
    wanted: list[float],
    members: list,
    group_of_rest: list[int],
) -> None:
    """Equal probabilities are one group, and a facet in two is one outcome."""
    groups = match_by_probability("die", unit_vectors(normals), np.array(probabilities), wanted)
    assert groups.members == tuple(m if isinstance(m, tuple) else (m,) for m in members)
    assert groups.group_of_rest.tolist() == group_of_rest


def test_an_outcome_of_several_faces_is_matched_by_their_sum() -> None:
    """Both squares of a cuboid are one outcome, and its four sides another; at a height of 1.44,
    one side is about as probable as both squares."""
    for height in (0.47, 0.93, 1.0, 1.44, 1.6):
        poses = rest_poses(CORNERS * [1.0, 1.0, height])
        is_square = np.abs(poses.normals[:, 2]) > 0.5
        square = float(poses.probabilities[is_square].sum())
        wanted = [square, 1.0 - square]
        groups = match_by_probability("c", poses.normals, poses.probabilities, wanted)
        of_rest = [groups.members[group] for group in groups.group_of_rest]
        if height == 1.0:
            assert of_rest.count((0,)) == 2
        else:
            assert of_rest == [(0,) if one else (1,) for one in is_square], height


def test_dice_that_cannot_be_matched() -> None:
    for probabilities, wanted, message in (
        ([0.5, 0.5], [0.5, 0.25, 0.25], "at least as many rests as outcomes, got 2 rests"),
        ([0.5, 0.3, 0.2], [0.5, 0.25, 0.25], "got 0.3000 for 0.2500"),
        ([0.5, 0.5], [0.5, 0.5], "outcomes that differ in their geometric probabilities"),
    ):
        with pytest.raises(InputError, match=message):
            match_by_probability("die", AXES[: len(wanted)], np.array(probabilities), wanted)


def test_by_normals() -> None:
    """Rests have the outcome of the counted facet within five degrees; other rests have none."""
    shown = AXES[[0, 1, 3]]
    tilted = np.array([np.cos(np.radians(4.0)), np.sin(np.radians(4.0)), 0.0])
    groups = match_by_normals(np.vstack([AXES, tilted]), shown, [0, 1, 0])
    assert groups.members == ((0,), (1,))
    assert groups.group_of_rest.tolist() == [0, 1, -1, 0, 0]
