"""Resting poses: transforms, draws, margins, the complex, and what may be handed in."""

from __future__ import annotations

from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.stats import binomtest, kstest

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import roll_steps

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def random_rests(seed: int) -> RestPoses:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(6 + 4 * seed, 3)) * [1.0, 0.8, 0.6] + [2.0, 0.0, -1.0]
    return rest_poses(points)


def support(rests: RestPoses, directions: np.ndarray) -> np.ndarray:
    """Height of the center of mass for unit directions (n, 3)."""
    return (directions @ (rests.hull.vertices - rests.center_of_mass).T).max(axis=1)


def assert_stands(rests: RestPoses, rest: int, transform: np.ndarray) -> None:
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


@pytest.mark.parametrize("seed", range(8))
def test_bodies_stand_in_the_poses_of_their_rests_and_in_those_drawn(seed: int) -> None:
    rests = random_rests(seed)
    for rest, transform in enumerate(rests.transforms):
        assert_stands(rests, rest, transform)
    transforms, drawn = rests.sample(20, np.random.default_rng(5))
    for rest, transform in zip(drawn, transforms, strict=True):
        assert_stands(rests, rest, transform)


@pytest.mark.parametrize("seed", range(8))
def test_rests_are_sorted_and_sum_to_one(seed: int) -> None:
    rests = random_rests(seed)
    assert (np.diff(rests.probabilities) <= 0).all()
    assert (rests.probabilities > 0).all()
    assert rests.probabilities.sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_margins_are_the_nearest_ways_out(seed: int) -> None:
    """The lowest passes out of a basin are its saddles: compare angles with all edges at whose
    nearest point the body balances, found by brute force on the support function."""
    rests = random_rests(seed)
    hull, center = rests.hull, rests.center_of_mass
    expected = np.full(len(rests.normals), np.pi)
    for edge in np.flatnonzero(hull.tail < hull.head):
        a, b = hull.vertices[hull.tail[edge]] - center, hull.vertices[hull.head[edge]] - center
        t = -(a @ (b - a)) / ((b - a) @ (b - a))
        foot = a + t * (b - a)
        if not 0 < t < 1 or support(rests, foot[None])[0] > foot @ foot * (1 + 1e-12):
            continue
        down = foot / np.linalg.norm(foot)
        across = np.cross(b - a, down)
        ends = [
            roll_steps(rests.morse.equilibria, down + s * 1e-7 * across)[-1].down for s in (-1, 1)
        ]
        basins = [int(np.argmax(rests.normals @ end)) for end in ends]
        if basins[0] != basins[1]:
            for basin in basins:
                angle = float(angle_between(rests.normals[basin], down))
                expected[basin] = min(expected[basin], angle)
    np.testing.assert_allclose(rests.margins, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_polylines_run_between_maxima_and_separate_their_basins(seed: int) -> None:
    rests = random_rests(seed)
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
            middle = (start + stop) / np.linalg.norm(start + stop)
            aside = np.cross(middle, stop - start)
            aside *= 1e-6 / np.linalg.norm(aside)
            if np.linalg.norm(stop - start) < 1e-4:
                continue
            for basin, sign in ((left, 1.0), (right, -1.0)):
                ended = roll_steps(morse.equilibria, middle + sign * aside)[-1].down
                np.testing.assert_array_equal(ended, rests.normals[basin])


@pytest.mark.parametrize("seed", range(8))
def test_basins_of_facets_agree_with_rolls(seed: int) -> None:
    rests = random_rests(seed)
    basins = rests.morse.basin_of_facet
    np.testing.assert_array_equal(basins[rests.facets], np.arange(len(rests.facets)))
    for normal, basin in zip(rests.hull.normals, basins, strict=True):
        ended = roll_steps(rests.morse.equilibria, normal)[-1].down
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
        assert set(rests.seconds) == {"hull", "rest"}
    assert rest_poses(mesh).center_of_mass_source == "uniform solid"
    assert rest_poses(mesh, "hull").center_of_mass_source == "uniform solid hull"
    given_center = rest_poses(mesh, [0.1, 0.2, 0.3])
    assert given_center.center_of_mass_source == "given"
    np.testing.assert_array_equal(given_center.center_of_mass, [0.1, 0.2, 0.3])


def test_a_flat_body_is_named(tmp_path: Path) -> None:
    path = tmp_path / "flat.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n")
    with pytest.raises(DegenerateBodyError, match=r"flat\.obj: expected points that span a solid"):
        rest_poses(read_body(path))
    with pytest.raises(DegenerateBodyError, match=r"^points: expected points that span a solid"):
        rest_poses([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])


DRAWN_FROM = random_rests(2)

DRAWS = 4000


def test_sampled_rests_have_their_probabilities() -> None:
    """Each count is inside its exact interval of 99.9 %; of random seeds one in a hundred fails."""
    _, rests = DRAWN_FROM.sample(DRAWS, 11)
    assert len(rests) == DRAWS
    for rest, p in enumerate(DRAWN_FROM.probabilities):
        count = int(np.count_nonzero(rests == rest))
        interval = binomtest(count, DRAWS).proportion_ci(0.999, method="exact")
        assert interval.low <= p <= interval.high


def test_headings_are_uniform() -> None:
    transforms, rests = DRAWN_FROM.sample(DRAWS, 2)
    first = rests == 0
    headings = np.arctan2(transforms[first, 1, 0], transforms[first, 0, 0])
    assert kstest(headings, "uniform", args=(-np.pi, 2.0 * np.pi)).pvalue > 1e-3


def test_one_seed_is_one_result() -> None:
    once, again = DRAWN_FROM.sample(20, 7), DRAWN_FROM.sample(20, np.random.default_rng(7))
    np.testing.assert_array_equal(once.transforms, again.transforms)
    np.testing.assert_array_equal(once.rests, again.rests)
    assert (DRAWN_FROM.sample(20, 8).transforms != once.transforms).any()


@pytest.mark.parametrize("n", [-1, 1.5, "3", True, 10**12])
def test_absurd_numbers_of_draws_are_refused(n: Any) -> None:
    with pytest.raises(InputError, match="n: expected a whole number"):
        DRAWN_FROM.sample(n, 1)


@pytest.mark.parametrize("seed", range(3))
def test_digits_lost_by_a_far_origin_are_noted(seed: int) -> None:
    points = random_rests(seed).hull.vertices
    exact = rest_poses(points)
    for offset in (1e3, 1e6, 1e9):
        moved = rest_poses(points + offset)
        assert moved.notes == exact.notes
        np.testing.assert_allclose(moved.probabilities, exact.probabilities, rtol=0, atol=1e-5)
    assert any("rounded" in note for note in rest_poses(points + 1e12).notes)
