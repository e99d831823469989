"""Odds as functions of the center of mass."""

from __future__ import annotations

import numpy as np
import pytest
from common.boxes import box

from dicedesign.balance.center.rests_at import counted_for, pose_odds, rests_at, top_directions
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.poses import rest_poses
from tests.reference.gear import gear


def solid_angle(a: float, b: float, height: float) -> float:
    """Of a rectangle of sides 2 a and 2 b, from above its middle."""
    return float(4.0 * np.arctan(a * b / (height * np.sqrt(a * a + b * b + height * height))))


def test_odds_of_a_box_are_its_solid_angles() -> None:
    hull = convex_hull(box((2.0, 4.0, 6.0)).points)
    rests = rests_at(hull, np.array([1.0, 2.0, 1.0]))
    assert rests is not None
    down = rests.normals @ [0.0, 0.0, -1.0] > 0.9
    assert rests.odds[down][0] == pytest.approx(solid_angle(1.0, 2.0, 1.0) / (4.0 * np.pi))
    assert rests.odds.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.03, -0.05, 0.02), (-0.1, 0.04, 0.05)])
def test_slopes_are_those_of_finite_differences(shift: tuple[float, float, float]) -> None:
    hull = convex_hull(box((1.0, 1.3, 1.7), (0.4, 0.2, 0.0)).points)
    center = hull.centroid + np.array(shift)
    rests = rests_at(hull, center)
    assert rests is not None
    slopes, step = rests.slopes(np.eye(len(rests.odds))), 1e-6
    for axis in range(3):
        beside = [rests_at(hull, center + s * step * np.eye(3)[axis]) for s in (-1.0, 1.0)]
        before, after = (found.odds for found in beside if found is not None)
        np.testing.assert_allclose(slopes[:, axis], (after - before) / (2.0 * step), atol=1e-8)


def test_there_are_none_outside() -> None:
    hull = convex_hull(box((1.0, 1.0, 1.0)).points)
    assert rests_at(hull, np.array([0.5, 0.5, 1.5])) is None


def test_rests_that_are_one_to_the_eye_are_one_pose() -> None:
    hull = convex_hull(gear().points)
    rests = rests_at(hull, hull.centroid)
    assert rests is not None
    directions = top_directions(rests, 3)
    odds = counted_for(rests, directions) @ rests.odds
    assert (np.diff(odds) <= 0.0).all()
    angles = np.degrees(np.arccos((directions @ directions.T).clip(-1.0, 1.0)))
    assert angles[np.triu_indices(3, 1)].min() > 5.0


def test_a_pose_that_the_body_has_not_has_no_odds() -> None:
    poses = rest_poses(box((1.0, 1.0, 1.0)).points)
    odds = pose_odds(poses, np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 1.0]]) / [[np.sqrt(3.0)], [1.0]])
    np.testing.assert_allclose(odds, [0.0, 1.0 / 6.0], atol=1e-12)
