"""Goals, regions, gradients of probabilities, and best centers of mass."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from common.bodies import box
from common.paths import public_data

from dicedesign.balance.balanced import CenterSearch, best_center, whole_hull
from dicedesign.balance.goals import (
    EqualProbabilities,
    FewestRests,
    GivenProbabilities,
    Standing,
    rests_at,
)
from dicedesign.balance.regions import Halfspaces, least_within
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: EqualProbabilities(1), "equal: expected a whole number of at least 2"),
        (lambda: Standing(), "stand: expected the number of a pose or the direction .* neither"),
        (lambda: Standing(1, (0.0, 0.0, 1.0)), "got both"),
        (lambda: Standing(pose=0), "stand: expected a whole number above 0, got 0"),
        (lambda: Standing(down=(0.0, 0.0, 0.0)), "other than 0,0,0"),
        (lambda: GivenProbabilities((0.5, 0.6)), "a sum of at most 1, got 0.5, 0.6;"),
        (lambda: GivenProbabilities((float("nan"),)), "of 1 to 100 poses, above 0"),
        (lambda: GivenProbabilities((0.5, 0.2), (1,)), "poses: expected 2 numbers of poses"),
        (lambda: GivenProbabilities((0.5, 0.2), (1, 1)), "each once"),
    ],
)
def test_goals_that_are_refused(make: Callable[[], object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()


def test_the_effort_falls_with_the_corners_of_a_hull() -> None:
    whole = CenterSearch(samples=500, descents=8, steps=40)
    assert whole.for_corners(8) == whole
    efforts = [whole.for_corners(count) for count in (10**3, 10**4, 10**5, 10**6)]
    for name in ("samples", "descents", "steps"):
        numbers = [getattr(each, name) for each in (whole, *efforts)]
        assert numbers == sorted(numbers, reverse=True)
        assert 0 < numbers[-1] < numbers[0]
    # However many corners there are, and however little is asked for.
    assert whole.for_corners(10**9) == efforts[-1]
    least = CenterSearch(samples=1, descents=1, steps=1)
    assert least.for_corners(10**6) == least


def test_the_intersection_of_two_boxes() -> None:
    corners = box((2.0, 2.0, 2.0)).points
    one, other = (
        Halfspaces.of_hull(convex_hull(corners * scale + shift))
        for scale, shift in ((1.0, 0.0), ([1.0, 1.0, 1.25], [1.0, -1.0, 1.5]))
    )
    both = one.and_within(other)
    common = both.corners()
    assert common is not None
    np.testing.assert_allclose(common.vertices.min(axis=0), [1.0, 0.0, 1.5], atol=1e-12)
    np.testing.assert_allclose(common.vertices.max(axis=0), [2.0, 1.0, 2.0], atol=1e-12)
    place, depth = both.deepest
    assert depth == pytest.approx(0.25)
    assert place[2] == pytest.approx(1.75)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.03, -0.05, 0.02), (-0.1, 0.04, 0.05)])
def test_slopes_against_finite_differences(shift: tuple[float, float, float]) -> None:
    hull = convex_hull(box((1.0, 1.3, 1.7), (0.4, 0.2, 0.0)).points)
    center = hull.centroid + np.array(shift)
    rests = rests_at(hull, center)
    assert rests is not None
    slopes, step = rests.slopes(np.eye(len(rests.probabilities))), 1e-6
    for axis in range(3):
        beside = [rests_at(hull, center + s * step * np.eye(3)[axis]) for s in (-1.0, 1.0)]
        before, after = (neighbor.probabilities for neighbor in beside if neighbor is not None)
        np.testing.assert_allclose(slopes[:, axis], (after - before) / (2.0 * step), atol=1e-8)


QUICK = CenterSearch(samples=150, descents=4, steps=40)

BLOCK = rest_poses(box((1.0, 1.3, 1.7), (0.5, 0.3, 0.0)).points)
"""A leaning box without symmetry but about its middle."""


def test_a_standing_cube_has_the_solid_angle_of_its_face() -> None:
    poses = rest_poses(box((2.0, 2.0, 2.0)).points - 1.0)
    best = best_center(poses, Standing(down=(0.0, 0.0, -1.0)), whole_hull(poses.hull), 1e-3, QUICK)
    # The center is 5 % of the half side above the middle of the face.
    height = 0.05
    angle = 4.0 * np.arctan(1.0 / (height * np.sqrt(2.0 + height * height)))
    assert best.probabilities[0] == pytest.approx(angle / (4.0 * np.pi), abs=1e-5)
    np.testing.assert_allclose(best.center, [0.0, 0.0, -0.95], atol=5e-3)
    assert best.reached


def random_tetrahedra(loadable: bool, count: int, seed: int) -> list[np.ndarray]:
    """Random tetrahedra with or without a path of three obtuse dihedral angles over all faces.

    These, and no others, rest on one face alone with some center of mass. Source: Almádi, Dawson
    and Domokos, Building a monostable tetrahedron (2025).
    """
    found, rng = [], np.random.default_rng(seed)
    while len(found) < count:
        points = rng.normal(size=(4, 3))
        # Gradients of barycentric coordinates point away from faces.
        inward = np.linalg.inv(np.column_stack([points, np.ones(4)]))[:3].T
        is_obtuse = inward @ inward.T > 0.0
        orders = itertools.permutations(range(4))
        if loadable == any(all(is_obtuse[pair] for pair in itertools.pairwise(q)) for q in orders):
            found.append(points)
    return found


@pytest.mark.parametrize("loadable", [True, False])
def test_tetrahedra_with_an_obtuse_path_rest_in_one_way(loadable: bool) -> None:
    tetrahedra = random_tetrahedra(loadable, 20, 1)
    if loadable:
        tetrahedra.append(read_body(public_data("cases/09_loadable_tetrahedron.stl")).points)
    for points in tetrahedra:
        best = best_center(rest_poses(points), FewestRests())
        assert best.rests == len(rest_poses(points, best.center).facets) == best.rests_at_least
        assert (best.rests == 1) == loadable
        assert best.clearance > 0.0


@pytest.mark.parametrize("reach", [1.0, 0.4])
@pytest.mark.parametrize("count", [6, 9, 20])
def test_no_random_center_has_fewer_rests(
    count: int, reach: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(count)
    poses = rest_poses(rng.normal(size=(count, 3)))
    hull = poses.hull
    region = convex_hull(hull.centroid + reach * (hull.vertices - hull.centroid))
    best = best_center(poses, FewestRests(), region)
    assert (region.heights(best.center) >= 0.0).all()
    weights = rng.dirichlet(np.full(len(region.vertices), 0.3), 500)
    for center in weights @ region.vertices:
        assert len(rest_poses(hull.vertices, center).facets) >= best.rests
    assert best.rests_at_least == best.rests
    # A search that ends at once has no proof.
    monkeypatch.setattr("dicedesign.balance.regions.MAX_DISTANCES", 0)
    unproven = best_center(poses, FewestRests(), region)
    assert unproven.rests_at_least <= best.rests <= unproven.rests


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (Standing(pose=9), "stand: expected the number of a pose from 1 to 6, got 9"),
        (Standing(down=(1.0, 1.0, 1.0)), "stand: expected a direction within 5 degrees"),
        (
            GivenProbabilities((0.5, 0.1), (1, 8)),
            "poses: expected the number of a pose from 1 to 6, got 8",
        ),
    ],
)
def test_poses_that_a_body_does_not_have(goal: Standing | GivenProbabilities, said: str) -> None:
    poses = rest_poses(box((1.0, 2.0, 3.0)).points)
    with pytest.raises(InputError, match=said):
        best_center(poses, goal, whole_hull(poses.hull), 1e-3, QUICK)


@pytest.mark.full
def test_the_bunny_has_six_poses_of_nearer_probabilities_and_fewer_others() -> None:
    """Figure 12."""
    poses = rest_poses(read_body(public_data("models/bunny.obj")))
    best = best_center(poses, EqualProbabilities(6), whole_hull(poses.hull), 1e-3)
    now = rest_poses(poses.hull.vertices, best.center).probabilities
    assert np.ptp(now[:6]) < 0.5 * np.ptp(poses.probabilities[:6])
    assert now[:6].sum() > 0.9 > poses.probabilities[:6].sum()
    assert len(now) < len(poses.probabilities)


@pytest.mark.parametrize("seed", range(3))
def test_the_constrained_minimum_has_no_descent_direction(seed: int) -> None:
    random = np.random.default_rng(seed)
    region = convex_hull(random.normal(size=(20, 3)) + 0.2)
    root = random.normal(size=(3, 3))
    form, slope = root @ root.T, 3.0 * random.normal(size=3)
    least = least_within(form, slope, region.normals, region.heights(np.zeros(3)))
    assert region.depths(least[None]).min() >= -1e-9
    # Optimality condition of a convex function.
    assert ((region.vertices - least) @ (form @ least + slope)).min() >= -1e-7


def test_the_center_stays_in_the_region() -> None:
    low, high = BLOCK.center_of_mass - 0.1, BLOCK.center_of_mass + 0.1
    region = convex_hull(low + box((1.0, 1.0, 1.0)).points * (high - low))
    best = best_center(BLOCK, Standing(pose=2), region, 1e-3, QUICK)
    assert (region.heights(best.center) >= -1e-9).all()
    everywhere = best_center(BLOCK, Standing(pose=2), whole_hull(BLOCK.hull), 1e-3, QUICK)
    assert best.before[0] < best.probabilities[0] < everywhere.probabilities[0]
