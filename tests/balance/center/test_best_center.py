"""Centers of mass that serve goals."""

from __future__ import annotations

import numpy as np
import pytest
from common.boxes import box
from common.paths import public_data

from dicedesign.balance.center.best_center import CenterSearch, best_center, whole_hull
from dicedesign.balance.center.goals import EqualOdds, FewestRests, GivenOdds, Standing
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import RestPoses, rest_poses

QUICK = CenterSearch(samples=150, descents=4, steps=40)

BLOCK = rest_poses(box((1.0, 1.3, 1.7), (0.5, 0.3, 0.0)).points)
"""A leaning box without symmetry but about its middle."""


def odds_with(poses: RestPoses, center: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Odds of the rests with directions, by the forward model alone."""
    now = rest_poses(poses.hull.vertices, center)
    near = directions @ now.normals.T > np.cos(np.radians(5.0))
    return np.asarray(near @ now.probabilities)


def test_a_cube_stands_as_well_as_its_solid_angle_lets_it() -> None:
    poses = rest_poses(box((2.0, 2.0, 2.0)).points - 1.0)
    found = best_center(poses, Standing(down=(0.0, 0.0, -1.0)), whole_hull(poses.hull), 1e-3, QUICK)
    # It is 5 % of the half side above the face, in the middle.
    height = 0.05
    angle = 4.0 * np.arctan(1.0 / (height * np.sqrt(2.0 + height * height)))
    assert found.odds[0] == pytest.approx(angle / (4.0 * np.pi), abs=1e-5)
    np.testing.assert_allclose(found.center, [0.0, 0.0, -0.95], atol=5e-3)
    assert found.reached


def test_odds_that_a_center_of_mass_has_are_found() -> None:
    given = BLOCK.center_of_mass + np.array([0.12, -0.1, 0.15])
    wanted = odds_with(BLOCK, given, BLOCK.normals[:3])
    goal = GivenOdds(tuple(wanted.tolist()), (1, 2, 3))
    found = best_center(BLOCK, goal, whole_hull(BLOCK.hull), 1e-6, QUICK)
    assert found.reached
    np.testing.assert_allclose(odds_with(BLOCK, found.center, BLOCK.normals[:3]), wanted, atol=1e-6)


def test_three_equal_odds() -> None:
    found = best_center(BLOCK, EqualOdds(3), whole_hull(BLOCK.hull), 1e-3, QUICK)
    assert found.reached
    odds = odds_with(BLOCK, found.center, found.directions)
    assert np.ptp(odds) <= 1e-3
    now = rest_poses(BLOCK.hull.vertices, found.center)
    assert now.probabilities[3:].max(initial=0.0) <= odds.min() + 1e-12


def test_more_than_three_coordinates_can_do_is_told() -> None:
    goal = GivenOdds((0.7, 0.05, 0.05, 0.2), (1, 2, 3, 4))
    found = best_center(BLOCK, goal, whole_hull(BLOCK.hull), 1e-6, QUICK)
    assert not found.reached
    assert found.error is not None
    assert found.error > 1e-3


def test_a_box_rests_on_all_sides_wherever_its_center_of_mass_is() -> None:
    poses = rest_poses(box((1.0, 2.0, 3.0)).points)
    found = best_center(poses, FewestRests(), whole_hull(poses.hull), 1e-3, QUICK)
    assert (found.rests, found.rests_before, found.reached) == (6, 6, False)


def test_no_center_of_a_grid_has_fewer_rests() -> None:
    poses = rest_poses(box((1.0, 1.2, 2.5), (1.6, 0.7, 0.0)).points)
    region = whole_hull(poses.hull)
    found = best_center(poses, FewestRests(), region, 1e-3, QUICK)
    low, high = region.vertices.min(axis=0), region.vertices.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 8).T), axis=-1).reshape(-1, 3)
    inside = grid[(region.depths(grid) > 1e-9).all(axis=1)]
    counts = [len(rest_poses(poses.hull.vertices, center).facets) for center in inside]
    assert found.rests <= min(counts) < len(poses.facets)
    assert len(rest_poses(poses.hull.vertices, found.center).facets) == found.rests
    assert found.clearance > 0.0


def test_the_same_every_time() -> None:
    one, other = (
        best_center(BLOCK, EqualOdds(2), whole_hull(BLOCK.hull), 1e-3, QUICK) for _ in range(2)
    )
    np.testing.assert_array_equal(one.center, other.center)


def test_a_region_is_kept_to() -> None:
    low, high = BLOCK.center_of_mass - 0.1, BLOCK.center_of_mass + 0.1
    region = convex_hull(low + box((1.0, 1.0, 1.0)).points * (high - low))
    found = best_center(BLOCK, Standing(pose=2), region, 1e-3, QUICK)
    assert (region.heights(found.center) >= -1e-9).all()
    everywhere = best_center(BLOCK, Standing(pose=2), whole_hull(BLOCK.hull), 1e-3, QUICK)
    assert found.before[0] < found.odds[0] < everywhere.odds[0]


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (Standing(pose=9), "stand: expected the number of a pose from 1 to 6, got 9"),
        (Standing(down=(1.0, 1.0, 1.0)), "stand: expected a direction within 5 degrees"),
        (GivenOdds((0.5, 0.1), (1, 8)), "poses: expected the number of a pose from 1 to 6, got 8"),
    ],
)
def test_poses_that_a_body_has_not(goal: Standing | GivenOdds, said: str) -> None:
    poses = rest_poses(box((1.0, 2.0, 3.0)).points)
    with pytest.raises(InputError, match=said):
        best_center(poses, goal, whole_hull(poses.hull), 1e-3, QUICK)


def test_the_bunny_has_six_poses_of_nearer_odds_and_fewer_others() -> None:
    """Figure 12."""
    poses = rest_poses(read_body(public_data("models/bunny.obj")))
    found = best_center(poses, EqualOdds(6), whole_hull(poses.hull), 1e-3)
    now = rest_poses(poses.hull.vertices, found.center).probabilities
    assert np.ptp(now[:6]) < 0.5 * np.ptp(poses.probabilities[:6])
    assert now[:6].sum() > 0.9 > poses.probabilities[:6].sum()
    assert len(now) < len(poses.probabilities)
