"""Solid angles, angles, rotations and similarities against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dicedesign.geometry.sphere import (
    Similarity,
    angle_between,
    best_similarity,
    rotation_between,
    signed_solid_angle,
)
from dicedesign.runtime.arrays import Floats


@pytest.mark.parametrize("seed", range(10))
def test_facets_of_a_tetrahedron_cover_the_sphere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(4, 3))
    corners -= rng.dirichlet(np.ones(4)) @ corners
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    a, b, c = corners[faces].transpose(1, 0, 2)
    angles = signed_solid_angle(a, b, c, np)
    assert abs(angles.sum()) == pytest.approx(4 * np.pi, rel=1e-14)
    np.testing.assert_allclose(signed_solid_angle(b, c, a, np), angles, rtol=1e-12)
    np.testing.assert_allclose(signed_solid_angle(b, a, c, np), -angles, rtol=1e-12)


@pytest.mark.parametrize("angle", [1e-12, 1e-8, 1e-3, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-9])
def test_angles_are_exact(angle: float) -> None:
    a = np.array([2.0, 0.0, 0.0])
    b = 5.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
    assert angle_between(a, b) == pytest.approx(angle, rel=1e-15)
    assert np.pi - angle_between(a, -b) == pytest.approx(angle, rel=1e-15, abs=1e-15)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-12, 1e-6, 0.5, 3.0, np.pi - 1e-6, np.pi - 1e-9, np.pi - 1e-12, np.pi]
)
@pytest.mark.parametrize("seed", range(20))
def test_rotations_are_the_smallest(angle: float, seed: int) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    a = turn @ np.array([0.0, 0.0, 1.0])
    b = turn @ np.array([np.sin(angle), 0.0, np.cos(angle)])
    rotation = rotation_between(3.0 * a, 0.2 * b)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=4e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0, rel=1e-14)
    np.testing.assert_allclose(rotation @ a, b, rtol=0, atol=4e-15)
    assert Rotation.from_matrix(rotation).magnitude() == pytest.approx(angle, abs=1e-7)
    if 0.0 < angle < np.pi - 1e-6:
        axis = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
        np.testing.assert_allclose(rotation @ axis, axis, rtol=0, atol=1e-15 / np.sin(angle))


def clouds(seed: int) -> tuple[Floats, Floats, Floats]:
    """Points, others that are unlike them, and weights."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(30, 3)), rng.normal(size=(30, 3)), rng.uniform(0.0, 2.0, 30)


@pytest.mark.parametrize("seed", range(3))
def test_a_known_similarity_is_found(seed: int) -> None:
    points, _, weights = clouds(seed)
    rotation = Rotation.from_rotvec([1.0, -2.0, 0.5 + seed]).as_matrix()
    known = Similarity(2.5, rotation, np.array([3.0, -1.0, 7.0]))
    similarity = best_similarity(points, known(points), weights)
    assert similarity.scale == pytest.approx(known.scale, rel=1e-13)
    np.testing.assert_allclose(similarity.rotation, known.rotation, atol=1e-13)
    np.testing.assert_allclose(similarity.shift, known.shift, atol=1e-13)
    np.testing.assert_allclose(known(points[4]), known(points)[4], rtol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_its_rotation_is_that_of_scipy(seed: int) -> None:
    points, onto, weights = clouds(seed)
    parts = weights / weights.sum()
    expected, _ = Rotation.align_vectors(onto - parts @ onto, points - parts @ points, weights)
    similarity = best_similarity(points, onto, weights)
    np.testing.assert_allclose(similarity.rotation, expected.as_matrix(), atol=1e-7)
