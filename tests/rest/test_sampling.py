"""Poses drawn by their probabilities: how often, how they stand, and what may be asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest, kstest

from dicedesign import rest_poses
from dicedesign.errors import InputError
from dicedesign.rest.poses import RestPoses

DRAWS = 4000


@pytest.fixture(scope="module")
def poses() -> RestPoses:
    points = np.random.default_rng(3).normal(size=(14, 3)) * [1.0, 0.8, 0.6] + [5.0, -2.0, 1.0]
    return rest_poses(points)


def test_rests_come_up_as_often_as_they_are_probable(poses: RestPoses) -> None:
    """Each count is inside its exact interval of 99.9 %; of random seeds one in a hundred fails."""
    _, rests = poses.sample(DRAWS, 11)
    assert len(rests) == DRAWS
    for rest, p in enumerate(poses.probabilities):
        count = int(np.count_nonzero(rests == rest))
        interval = binomtest(count, DRAWS).proportion_ci(0.999, method="exact")
        assert interval.low <= p <= interval.high


def test_a_sampled_body_stands_on_the_plane_in_the_pose_it_is_said_to(poses: RestPoses) -> None:
    transforms, rests = poses.sample(50, np.random.default_rng(5))
    vertices = poses.hull.vertices
    for transform, rest in zip(transforms, rests, strict=True):
        turn, shift = transform[:3, :3], transform[:3, 3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(turn) == pytest.approx(1.0)
        np.testing.assert_array_equal(transform[3], [0.0, 0.0, 0.0, 1.0])
        np.testing.assert_allclose(turn @ poses.normals[rest], [0.0, 0.0, -1.0], atol=1e-14)
        placed = vertices @ turn.T + shift
        assert abs(placed[:, 2].min()) < 1e-13
        np.testing.assert_allclose((turn @ poses.center_of_mass + shift)[:2], 0.0, atol=1e-13)


def test_headings_are_uniform(poses: RestPoses) -> None:
    transforms, rests = poses.sample(DRAWS, 2)
    first = rests == 0
    headings = np.arctan2(transforms[first, 1, 0], transforms[first, 0, 0])
    assert kstest(headings, "uniform", args=(-np.pi, 2.0 * np.pi)).pvalue > 1e-3


def test_one_seed_is_one_result(poses: RestPoses) -> None:
    once, again = poses.sample(20, 7), poses.sample(20, np.random.default_rng(7))
    np.testing.assert_array_equal(once.transforms, again.transforms)
    np.testing.assert_array_equal(once.rests, again.rests)
    assert (poses.sample(20, 8).transforms != once.transforms).any()


@pytest.mark.parametrize("n", [-1, 1.5, "3", True, 10**12])
def test_a_number_of_draws_that_cannot_be_meant(poses: RestPoses, n: Any) -> None:
    with pytest.raises(InputError, match="n: expected a whole number"):
        poses.sample(n, 1)
