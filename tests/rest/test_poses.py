"""Resting poses: transforms, draws, margins, asymmetry, the complex, and what may be handed in."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest, kstest

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.morse import basin_moments, separatrix_points
from dicedesign.rest.outcomes import asymmetry, border_margins
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import RollStep, roll_steps
from dicedesign.runtime.arrays import Floats
from tests.reference import solids
from tests.reference.random_hulls import off_center_body

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def random_rests(seed: int) -> RestPoses:
    """Rests of a uniform body off the origin."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(6 + 4 * seed, 3)) * [1.0, 0.8, 0.6] + [2.0, 0.0, -1.0]
    return rest_poses(points)


SEVERAL = [random_rests(seed) for seed in range(8)]


def support(rests: RestPoses, directions: Floats) -> Floats:
    """Height of the center of mass for unit directions (n, 3)."""
    return (directions @ (rests.hull.vertices - rests.center_of_mass).T).max(axis=1)


def assert_stands(rests: RestPoses, rest: int, transform: Floats) -> None:
    """On the plane z = 0, on the facet of a rest, with the center of mass on the z axis."""
    turn, shift, normal = transform[:3, :3], transform[:3, 3], rests.normals[rest]
    np.testing.assert_array_equal(transform[3], [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(turn @ normal, [0, 0, -1], rtol=0, atol=1e-14)
    heights = rests.hull.polygon(rests.facets[rest]) @ turn.T[:, 2] + shift[2]
    np.testing.assert_allclose(heights, 0, atol=1e-13)
    assert (rests.hull.vertices @ turn.T[:, 2] + shift[2]).min() > -1e-13
    center = turn @ rests.center_of_mass + shift
    np.testing.assert_allclose(center[:2], 0.0, atol=1e-13)
    assert center[2] == pytest.approx(support(rests, normal[None])[0])


def test_bodies_stand_in_the_poses_of_their_rests_and_in_those_drawn() -> None:
    for rests in SEVERAL:
        assert (np.diff(rests.probabilities) <= 0).all()
        assert rests.probabilities.min() > 0
        assert rests.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
        for rest, transform in enumerate(rests.transforms):
            assert_stands(rests, rest, transform)
        transforms, drawn = rests.sample(20, np.random.default_rng(5))
        for rest, transform in zip(drawn, transforms, strict=True):
            assert_stands(rests, rest, transform)


def test_margins_are_the_nearest_ways_out() -> None:
    """The lowest passes out of a basin are its saddles: compare angles with all edges at whose
    nearest point the body balances, found by brute force on the support function."""
    for rests in SEVERAL:
        hull, center = rests.hull, rests.center_of_mass
        expected = np.full(len(rests.normals), np.pi)
        for edge in np.flatnonzero(hull.tail < hull.head):
            a, b = hull.vertices[hull.tail[edge]] - center, hull.vertices[hull.head[edge]] - center
            t = -(a @ (b - a)) / ((b - a) @ (b - a))
            foot = a + t * (b - a)
            if not 0 < t < 1 or support(rests, foot[None])[0] > foot @ foot * (1 + 1e-12):
                continue
            down = foot / np.linalg.norm(foot)
            across = 1e-7 * np.cross(b - a, down)
            sides = (down - across, down + across)
            ends = [roll_steps(rests.morse.equilibria, side)[-1].down for side in sides]
            basins = [int(np.argmax(rests.normals @ end)) for end in ends]
            if basins[0] != basins[1]:
                for basin in basins:
                    angle = float(angle_between(rests.normals[basin], down))
                    expected[basin] = min(expected[basin], angle)
        np.testing.assert_allclose(rests.margins, expected, rtol=0, atol=1e-12)


def test_margins_to_the_border_are_the_least_angles_of_points_along_it() -> None:
    part = np.linspace(0.0, 1.0, 4001)[:, None]
    for poses in SEVERAL[:5]:
        sampled = np.full(len(poses.normals), np.pi)
        for line, basins in zip(poses.morse.polylines, poses.morse.saddle_basins, strict=True):
            for (a, b), basin in product(pairwise(line), basins):
                angles = angle_between(poses.normals[basin], (1.0 - part) * a + part * b)
                sampled[basin] = min(sampled[basin], angles.min())
        margins = border_margins(poses)
        assert (margins <= sampled + 1e-12).all()
        np.testing.assert_allclose(margins, sampled, atol=1e-3)
        assert (margins <= poses.margins + 1e-12).all()


def test_moments_of_basins_are_mean_start_directions() -> None:
    """Within four standard errors, which are at most the root of probabilities over number."""
    poses, count = SEVERAL[1], 1500
    paths = poses.basins[0].paths
    points = separatrix_points(paths, poses.hull.vertices, poses.center_of_mass, np)
    moments = basin_moments(paths, points, np)
    np.testing.assert_allclose(moments.sum(axis=0), 0.0, atol=1e-13)
    directions = unit_vectors(np.random.default_rng(0).normal(size=(count, 3)))
    normals = np.array([roll_steps(poses.morse.equilibria, down)[-1].down for down in directions])
    for facet, moment in zip(paths.rests, moments, strict=True):
        inside = normals @ poses.hull.normals[facet] > 1.0 - 1e-9
        sampled = 4 * np.pi * directions[inside].sum(axis=0) / count
        assert np.abs(sampled - moment).max() < 4 * 4 * np.pi * np.sqrt(inside.mean() / count)


def test_asymmetry_and_margins_of_a_cube_and_a_box() -> None:
    """Between facets at distances s and t the saddle makes an angle of atan2(t, s) with the normal
    of the first; each pair of directions has four such edges."""
    cube = rest_poses(CUBE)
    assert asymmetry(cube) == pytest.approx(0.0, abs=1e-14)
    np.testing.assert_allclose(border_margins(cube), np.pi / 4, atol=1e-14)
    body = solids.box(1.0, 2.0, 3.5)
    assert body.shares is not None
    # Two facets each across the third, the first and the second edge.
    across, expected = dict(zip((3.5, 1.0, 2.0), body.shares[::2], strict=True)), 0.0
    for s, t in ((1.0, 2.0), (2.0, 3.5), (3.5, 1.0)):
        first = np.arctan2(t, s)
        phi = max(first, np.pi / 2 - first) / (np.pi / 2)
        expected += 4 * min(across[s], across[t]) * (phi - 0.5)
    turn = Rotation.random(random_state=5).as_matrix()
    assert asymmetry(rest_poses(body.points @ turn.T)) == pytest.approx(expected, abs=1e-13)


def test_two_rests_with_many_saddles_between_them_are_one_pair() -> None:
    """A flat body with unequal ends, which rolls over the middle of a near edge of its rim."""
    ends = [
        [x, y, z] for s, z in ((0.7, 0.3), (0.5, -0.3)) for x in (-2 * s, 2 * s) for y in (-s, s)
    ]
    rim = [[x, y, 0.0] for x in (-2.0, 2.0) for y in (-1.0, 1.0)]
    poses = rest_poses(np.array(ends + rim))
    assert (len(poses.probabilities), len(poses.morse.saddles)) == (2, 4)
    low = poses.center_of_mass[2]
    assert abs(low) > 0.01
    above = np.arctan2(1.0, abs(low))
    expected = poses.probabilities.min() * ((np.pi - above) / np.pi - 0.5)
    assert asymmetry(poses) == pytest.approx(expected, rel=1e-9)


def test_polylines_run_between_maxima_and_separate_their_basins() -> None:
    for rests in SEVERAL:
        morse = rests.morse
        assert len(morse.polylines) == len(morse.saddles) == len(morse.saddle_basins)
        for line, saddle, (left, right) in zip(
            morse.polylines, morse.saddles, morse.saddle_basins, strict=True
        ):
            np.testing.assert_allclose(np.linalg.norm(line, axis=1), 1.0, rtol=1e-14)
            at = int(np.argmin(np.linalg.norm(line - saddle, axis=1)))
            np.testing.assert_allclose(line[at], saddle, rtol=0, atol=1e-14)
            for end in (line[0], line[-1]):
                assert np.linalg.norm(morse.maxima - end, axis=1).min() < 1e-14
            heights = support(rests, line)
            assert (np.diff(heights[: at + 1]) < 1e-14).all()
            assert (np.diff(heights[at:]) > -1e-14).all()
            for start, stop in pairwise(line):
                if np.linalg.norm(stop - start) < 1e-4:
                    continue
                middle = unit_vectors(start + stop)
                aside = 1e-6 * unit_vectors(np.cross(middle, stop - start))
                for basin, place in ((left, middle + aside), (right, middle - aside)):
                    ended = roll_steps(morse.equilibria, place)[-1].down
                    np.testing.assert_array_equal(ended, rests.normals[basin])
        basins = morse.basin_of_facet
        np.testing.assert_array_equal(basins[rests.facets], np.arange(len(rests.facets)))
        for normal, basin in zip(rests.hull.normals, basins, strict=True):
            ended = roll_steps(morse.equilibria, normal)[-1].down
            np.testing.assert_array_equal(ended, rests.normals[basin])


def test_meshes_arrays_and_bodies_are_taken() -> None:
    mesh = trimesh.creation.box((1.0, 2.0, 3.0))
    points = np.asarray(mesh.vertices)
    expected = rest_poses(points.tolist())
    assert expected.center_of_mass_source == "uniform solid hull"
    assert expected.notes == ("the body has no triangles",)
    for given in (mesh, make_body(mesh.vertices, mesh.faces), trimesh.PointCloud(points)):
        rests = rest_poses(given)
        np.testing.assert_allclose(rests.probabilities, expected.probabilities, rtol=1e-12)
    assert rest_poses(mesh).center_of_mass_source == "uniform solid"
    assert rest_poses(mesh, "hull").center_of_mass_source == "uniform solid hull"
    given_center = rest_poses(mesh, [0.1, 0.2, 0.3])
    assert given_center.center_of_mass_source == "given"
    np.testing.assert_array_equal(given_center.center_of_mass, [0.1, 0.2, 0.3])


def test_sampled_rests_have_their_probabilities_and_headings_are_uniform() -> None:
    """Each count is inside its exact interval of 99.9 %; of random seeds one in a hundred fails."""
    poses, draws = SEVERAL[2], 4000
    transforms, rests = poses.sample(draws, 11)
    assert len(rests) == draws
    for rest, p in enumerate(poses.probabilities):
        count = int(np.count_nonzero(rests == rest))
        interval = binomtest(count, draws).proportion_ci(0.999, method="exact")
        assert interval.low <= p <= interval.high
    first = rests == 0
    headings = np.arctan2(transforms[first, 1, 0], transforms[first, 0, 0])
    assert kstest(headings, "uniform", args=(-np.pi, 2.0 * np.pi)).pvalue > 1e-3
    once, again = poses.sample(20, 7), poses.sample(20, np.random.default_rng(7))
    np.testing.assert_array_equal(once.transforms, again.transforms)
    np.testing.assert_array_equal(once.rests, again.rests)
    assert (poses.sample(20, 8).transforms != once.transforms).any()
    for n in (-1, 1.5, "3", True, 10**12):
        with pytest.raises(InputError, match="n: expected a whole number"):
            poses.sample(n, 1)  # type: ignore[arg-type]


def test_digits_lost_by_a_far_origin_are_noted() -> None:
    for exact in SEVERAL[:3]:
        points = exact.hull.vertices
        for offset in (1e3, 1e6, 1e9):
            moved = rest_poses(points + offset)
            assert moved.notes == exact.notes
            np.testing.assert_allclose(moved.probabilities, exact.probabilities, rtol=0, atol=1e-5)
        assert any("rounded" in note for note in rest_poses(points + 1e12).notes)


def place(step: RollStep, points: Floats) -> Floats:
    return points @ step.transform[:3, :3].T + step.transform[:3, 3]


def assert_on_the_table(equilibria: Equilibria, step: RollStep) -> None:
    turn = step.transform[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), rtol=0, atol=1e-13)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(turn @ step.down, [0, 0, -1], rtol=0, atol=1e-13)
    heights = place(step, equilibria.hull.vertices)[:, 2]
    assert heights.min() > -1e-12
    np.testing.assert_allclose(heights[list(step.vertices)], 0.0, atol=1e-12)
    assert sorted(step.vertices) == np.flatnonzero(heights < 1e-9).tolist()
    assert step.height == pytest.approx(place(step, equilibria.center_of_mass)[2], abs=1e-12)
    assert step.contact == {1: "vertex", 2: "edge"}.get(len(step.vertices), "facet")


@pytest.mark.parametrize("max_angle", [None, 0.3, 0.05])
def test_a_body_rolls_rigidly_downhill_without_slip(max_angle: float | None) -> None:
    """By no more than the largest angle in a step."""
    for seed in (0, 5, 11, 20):
        points, center = off_center_body(seed)
        equilibria = classify(convex_hull(points), center)
        for down in np.random.default_rng(seed).normal(size=(12, 3)):
            steps = roll_steps(equilibria, down, max_angle)
            np.testing.assert_allclose(place(steps[0], center)[:2], 0.0, atol=1e-12)
            for step in steps:
                assert_on_the_table(equilibria, step)
            for before, after in pairwise(steps):
                assert after.height < before.height
                pivots = sorted(set(before.vertices) & set(after.vertices))
                assert pivots
                turn = after.transform[:3, :3] @ before.transform[:3, :3].T
                angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
                assert max_angle is None or angle <= max_angle + 1e-7
                corners = equilibria.hull.vertices[pivots]
                moved = place(after, corners) - place(before, corners)
                np.testing.assert_allclose(moved, 0.0, atol=1e-12)


def test_a_body_at_rest_stays_and_bad_directions_are_refused() -> None:
    cube = classify(convex_hull(CUBE), [0, 0, 0])
    for down in cube.hull.normals:
        (step,) = roll_steps(cube, 4.0 * down)
        np.testing.assert_allclose(step.down, down, atol=1e-15)
        assert (step.contact, step.height) == ("facet", pytest.approx(1.0))
    for bad in ([0, 0, 0], [1, 2], [np.nan, 0, 1], [[0, 0, 1]]):
        with pytest.raises(InputError, match=r"^down: expected three finite numbers, not all zero"):
            roll_steps(cube, bad)
