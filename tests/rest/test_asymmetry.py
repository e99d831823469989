"""Asymmetry, margins to the border and barycenters of basins, against closed forms and sampling."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.rest.equilibria import classify
from dicedesign.rest.morse import basin_moments, separatrices, separatrix_points
from dicedesign.rest.outcomes import asymmetry, border_margins
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import roll_steps

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
        probabilities = min(solid_angle(t, u, s), solid_angle(s, u, t)) / (4 * np.pi)
        expected += 4 * probabilities * (phi - 0.5)
    assert asymmetry(poses) == pytest.approx(expected, abs=1e-13)


def solid_angle(a: float, b: float, height: float) -> float:
    """Solid angle of a rectangle with half lengths a, b, from a height above its middle."""
    return 4 * np.arcsin(a * b / np.sqrt((a * a + height**2) * (b * b + height**2)))


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


@pytest.mark.parametrize("seed", range(3))
def test_moments_of_basins_are_mean_start_directions(seed: int) -> None:
    """Within four standard errors, which are at most the root of probabilities over number."""
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
