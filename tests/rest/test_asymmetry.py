"""Asymmetry, margins to the border and barycenters of basins, against closed forms and sampling."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.rest.asymmetry import asymmetry, basin_moments, border_margins
from dicedesign.rest.equilibria import classify
from dicedesign.rest.morse import separatrices, separatrix_points
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import roll_steps
from tests.reference.monostatic import conway_guy

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))
BOX = (1.0, 2.0, 3.5)


def box(a: float, b: float, c: float) -> np.ndarray:
    """Corners of a box with these half lengths, turned."""
    return CUBE * (a, b, c) @ Rotation.random(random_state=5).as_matrix().T


def random_body(seed: int, count: int = 9) -> RestPoses:
    """Corners off a stretched sphere, so that several basins meet in long borders."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return rest_poses(unit_vectors(points) * [1.0, 0.8, 1.4])


def test_a_cube_is_symmetric_and_its_borders_lie_at_45_degrees() -> None:
    poses = rest_poses(CUBE)
    assert asymmetry(poses) == pytest.approx(0.0, abs=1e-14)
    np.testing.assert_allclose(border_margins(poses), np.pi / 4, atol=1e-14)


def test_the_asymmetry_of_a_box() -> None:
    """Between facets at distances s and t the saddle makes an angle of atan2(t, s) with the normal
    of the first; each pair of directions has four such edges."""
    poses = rest_poses(box(*BOX))
    expected = 0.0
    for s, t, u in ((BOX[0], BOX[1], BOX[2]), (BOX[1], BOX[2], BOX[0]), (BOX[2], BOX[0], BOX[1])):
        first = np.arctan2(t, s)
        phi = max(first, np.pi / 2 - first) / (np.pi / 2)
        odds = min(solid_angle(t, u, s), solid_angle(s, u, t)) / (4 * np.pi)
        expected += 4 * odds * (phi - 0.5)
    assert asymmetry(poses) == pytest.approx(expected, abs=1e-13)


def test_basins_that_meet_at_many_saddles_count_once() -> None:
    """A coin stands on its two sides only; its rim is as long however many corners it has, and
    lies lowest at the middles of its edges."""
    for corners in (12, 40):
        angles = 2 * np.pi * np.arange(corners) / corners
        ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(corners)], axis=1)
        points = np.concatenate([ring, 0.9 * ring + [0.0, 0.0, 0.2]])
        poses = rest_poses(points)
        assert len(poses.normals) == 2
        assert len(poses.morse.saddles) == corners
        center = poses.center_of_mass[2]
        # The saddles are the feet of the center on the longer edges.
        down = np.arctan2(np.cos(np.pi / corners), center)
        phi = max(down, np.pi - down) / np.pi
        expected = poses.probabilities.min() * (phi - 0.5)
        assert asymmetry(poses) == pytest.approx(expected, abs=1e-12)


def test_the_lowest_of_several_saddles_counts() -> None:
    """By the definition, on bodies some of whose basins meet twice."""
    twice = 0
    for seed in range(8):
        poses = random_body(seed, 30)
        lowest: dict[tuple[int, ...], tuple[float, float]] = {}
        points = poses.hull.vertices - poses.center_of_mass
        for saddle, basins in zip(poses.morse.saddles, poses.morse.saddle_basins, strict=True):
            pair = tuple(sorted(basins.tolist()))
            twice += pair in lowest
            angles = [float(angle_between(poses.normals[i], saddle)) for i in pair]
            term = poses.probabilities[list(pair)].min() * (max(angles) / sum(angles) - 0.5)
            entry = (float((points @ saddle).max()), float(term))
            lowest[pair] = min(lowest.get(pair, entry), entry)
        expected = sum(term for _, term in lowest.values())
        assert asymmetry(poses) == pytest.approx(expected, abs=1e-13)
    assert twice


def solid_angle(a: float, b: float, height: float) -> float:
    """Of a rectangle with half lengths a, b, seen from above its middle."""
    return 4 * np.arcsin(a * b / np.sqrt((a * a + height**2) * (b * b + height**2)))


def test_the_margins_of_a_box_are_at_the_nearest_saddle() -> None:
    poses = rest_poses(box(*BOX))
    heights = poses.hull.heights(poses.center_of_mass)[poses.facets]
    for height, margin in zip(heights, border_margins(poses), strict=True):
        others = [length for length in BOX if abs(length - height) > 1e-9]
        assert margin == pytest.approx(np.arctan2(min(others), height), abs=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_margins_are_the_least_angles_of_points_along_the_border(seed: int) -> None:
    poses = random_body(seed)
    assert len(poses.normals) > 1
    part = np.linspace(0.0, 1.0, 4001)[:, None]
    sampled = np.full(len(poses.normals), np.pi)
    for line, basins in zip(poses.morse.polylines, poses.morse.saddle_basins, strict=True):
        for a, b in pairwise(line):
            for basin in basins:
                angles = angle_between(poses.normals[basin], (1.0 - part) * a + part * b)
                sampled[basin] = min(sampled[basin], angles.min())
    margins = border_margins(poses)
    assert (margins <= sampled + 1e-12).all()
    np.testing.assert_allclose(margins, sampled, atol=1e-3)
    assert (margins <= poses.margins + 1e-12).all()


def test_a_border_can_be_nearer_than_every_saddle() -> None:
    nearer = [border_margins(poses) < poses.margins - 1e-6 for poses in map(random_body, range(8))]
    assert np.concatenate(nearer).any()


def test_a_body_with_one_rest_has_no_border() -> None:
    body = conway_guy()
    poses = rest_poses(body.points, body.center)
    assert border_margins(poses).tolist() == [np.pi]
    assert asymmetry(poses) == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_moments_of_basins_are_mean_directions_of_what_rolls_there(seed: int) -> None:
    """Within four standard errors, which are at most the root of odds over number."""
    poses = random_body(seed)
    hull, count = poses.hull, 1500
    paths = separatrices(classify(hull, poses.center_of_mass))
    points = separatrix_points(paths, hull.vertices, poses.center_of_mass, np)
    moments = basin_moments(paths, points, np)
    np.testing.assert_allclose(moments.sum(axis=0), 0.0, atol=1e-13)
    directions = unit_vectors(np.random.default_rng(seed).normal(size=(count, 3)))
    normals = np.array(
        [roll_steps(poses.morse.equilibria, direction)[-1].down for direction in directions]
    )
    for facet, moment in zip(paths.rests, moments, strict=True):
        inside = normals @ hull.normals[facet] > 1.0 - 1e-9
        sampled = 4 * np.pi * directions[inside].sum(axis=0) / count
        assert np.abs(sampled - moment).max() < 4 * 4 * np.pi * np.sqrt(inside.mean() / count)


def test_moments_of_a_cube_and_in_torch() -> None:
    hull = convex_hull(CUBE)
    paths = separatrices(classify(hull, np.zeros(3)))
    points = separatrix_points(paths, hull.vertices, np.zeros(3), np)
    moments = basin_moments(paths, points, np)
    # The border has four arcs of angle acos(1/3) at 45 degrees to the normal.
    size = 4 * np.arccos(1 / 3) * np.sqrt(0.5) / 2
    np.testing.assert_allclose(moments, size * hull.normals[paths.rests], atol=1e-14)
    np.testing.assert_allclose(
        basin_moments(paths, torch.tensor(points), torch).numpy(), moments, atol=1e-15
    )
