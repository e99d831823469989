"""Bodies to throw: inertia by closed forms and another library, axes, rests and barriers."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.thrown import OCTAHEDRON, box, random_points, thrown

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.rigid_body import rigid_body


def test_a_box() -> None:
    a, b, c = 1.0, 1.3, 1.7
    body, _ = thrown(box(c, a, b))
    squared = a * a + b * b + c * c
    assert body.radius == pytest.approx(np.sqrt(squared))
    expected = np.array([a * a + b * b, a * a + c * c, b * b + c * c]) / 3.0 / squared
    np.testing.assert_allclose(body.moments, expected, rtol=1e-13)
    # The most probable rest is on the largest side, and nearest to tipping over its long edges.
    np.testing.assert_allclose(body.rest_heights * body.radius, [a, a, b, b, c, c])
    over = np.hypot([a, a, b, b, c, c], [b, b, a, a, a, a])
    np.testing.assert_allclose(body.barriers * body.radius, over, rtol=1e-13)


def test_a_hollow_body() -> None:
    """The hull touches the table, and the cavity weighs nothing."""
    outer, inner = trimesh.creation.box((2.0, 2.0, 2.0)), trimesh.creation.box((1.0, 1.0, 1.0))
    inner.invert()
    both = trimesh.util.concatenate([outer, inner])
    mesh = make_body(both.vertices, both.faces)
    body = rigid_body(mesh, rest_poses(mesh))
    # m s^2 / 6 of each cube, with masses 8 and 1 of 7.
    np.testing.assert_allclose(body.moments, (8 * 4 - 1) / 6 / 7 / 3, rtol=1e-12)
    assert len(body.vertices) == 8


@pytest.mark.parametrize("seed", range(5))
def test_against_another_library(seed: int) -> None:
    points = random_points(seed)
    body, poses = thrown(points)
    mesh = trimesh.Trimesh(points).convex_hull
    tensor = mesh.moment_inertia / mesh.volume
    found = body.axes @ np.diag(body.moments * body.radius**2) @ body.axes.T
    np.testing.assert_allclose(found, tensor, rtol=0, atol=1e-12 * np.abs(tensor).max())
    assert np.linalg.det(body.axes) == pytest.approx(1.0)
    assert (np.diff(body.moments) >= 0.0).all()
    arms = poses.hull.vertices - mesh.center_mass
    np.testing.assert_allclose(body.vertices @ body.axes.T * body.radius, arms, atol=1e-12)
    assert np.linalg.norm(body.vertices, axis=1).max() == pytest.approx(1.0)


def test_a_given_inertia() -> None:
    body = make_body(box(1.0, 2.0, 3.0))
    poses = rest_poses(body)
    tensor = np.diag([13.0, 10.0, 5.0]) / 3.0
    given, solid = rigid_body(body, poses, tensor), rigid_body(body, poses)
    np.testing.assert_allclose(given.moments, solid.moments, rtol=1e-13)
    np.testing.assert_allclose(np.abs(given.axes), np.abs(solid.axes), atol=1e-13)


@pytest.mark.parametrize(
    ("tensor", "message"),
    [
        (np.diag([0.1, 0.1, np.nan]), "of finite numbers, got .*; give xx,yy,zz,xy,xz,yz"),
        ([[0.1, 0.1, 0], [0, 0.1, 0], [0, 0, 0.1]], "make it equal to its transpose"),
        (
            np.diag([0.1, 0.2, -0.1]),
            "inertia: expected a positive definite tensor, got principal moments of -0.1, 0.1 and "
            "0.2; correct it or leave it out",
        ),
        (np.diag([0.1, 0.1, 0.3]), "no principal moment larger than the two others together"),
        (np.diag([1.0, 1.0, 1.0]), "whose moments sum to at most 2, got 1, 1 and 1; divide by the"),
    ],
)
def test_tensors_of_no_body(tensor: object, message: str) -> None:
    body = make_body(OCTAHEDRON)
    with pytest.raises(InputError, match=message):
        rigid_body(body, rest_poses(body), tensor)
