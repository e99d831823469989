"""Volume, centroid, angles, rotations and similarities against closed forms, trimesh and SciPy."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import trimesh
from common.bumpy import bumpy_sphere
from scipy.spatial.transform import Rotation

from dicedesign.geometry.meshes.body import consistent_winding
from dicedesign.geometry.sphere import (
    Similarity,
    angle_between,
    best_similarity,
    rotation_between,
    signed_solid_angle,
)
from dicedesign.geometry.triangles import is_closed, solid_properties
from dicedesign.runtime.arrays import Floats

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def sphere() -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    points = np.asarray(mesh.vertices) * [1.0, 1.3, 0.7]
    points[:, 0] += 0.2 * points[:, 1] ** 2  # no symmetry, so the centroid is nothing special
    return points, np.asarray(mesh.faces)


def exact_properties(points: np.ndarray, triangles: np.ndarray) -> tuple[float, np.ndarray]:
    """Volume and centroid by tetrahedra from the first point, rounded once."""
    exact = [[Fraction(x) for x in point] for point in points.tolist()]
    offsets = [[x - x0 for x, x0 in zip(point, exact[0], strict=True)] for point in exact]
    sixfold, moment = Fraction(0), [Fraction(0)] * 3
    for corners in triangles.tolist():
        a, b, c = (offsets[corner] for corner in corners)
        turns = [b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2] for i in range(3)]
        part = sum(x * turn for x, turn in zip(a, turns, strict=True))
        sixfold += part
        moment = [m + part * (a[i] + b[i] + c[i]) for i, m in enumerate(moment)]
    centroid = [float(x0 + m / sixfold / 4) for x0, m in zip(exact[0], moment, strict=True)]
    return float(sixfold / 6), np.array(centroid)


def hollow() -> tuple[np.ndarray, np.ndarray]:
    """A sphere without symmetry with a cavity off its middle."""
    points, faces = sphere()
    both = np.concatenate([points, 0.5 * points + [0.1, 0.2, 0.05]])
    return both, np.concatenate([faces, faces[:, ::-1] + len(points)])


@pytest.mark.parametrize("body", [sphere, hollow])
@pytest.mark.parametrize("aspect", [1e3, 1e6, 1e9])
@pytest.mark.parametrize("kind", ["needle", "blade", "plate"])
def test_thin_bodies_in_any_direction_lose_no_more_than_their_aspect(body, aspect, kind) -> None:
    points, faces = body()
    factors = {"needle": [1, 1, aspect], "blade": [1, aspect**0.5, aspect], "plate": [1, 1, 1e-9]}
    points = points * factors[kind]
    thinness = 1e9 if kind == "plate" else aspect
    limit = np.finfo(np.float64).eps * thinness
    for seed in range(3):
        turned = Rotation.random(random_state=seed).apply(points) + 0.3 * seed * np.ptp(points)
        volume, centroid = solid_properties(turned, faces)
        expected_volume, expected = exact_properties(turned, faces)
        assert volume == pytest.approx(expected_volume, rel=10 * limit)
        np.testing.assert_allclose(centroid, expected, rtol=0, atol=limit * np.ptp(points))


def test_no_volume_has_no_centroid() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 0]])
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for points in (flat, np.ones((3, 3))):
        volume, centroid = solid_properties(points, faces)
        assert volume == 0.0
        assert np.isnan(centroid).all()


@pytest.mark.parametrize(
    ("triangles", "closed"),
    [
        (TETRAHEDRON, True),
        (np.vstack((TETRAHEDRON, TETRAHEDRON[:, ::-1] + 4)), True),
        (np.vstack((TETRAHEDRON, np.array([0, 1, 4, 5])[TETRAHEDRON])), True),  # share an edge
        (TETRAHEDRON[:3], False),
        (np.vstack((TETRAHEDRON, TETRAHEDRON[:3] + 4)), False),
        (np.vstack((TETRAHEDRON[:3], TETRAHEDRON[3:, ::-1])), False),
        (np.vstack((TETRAHEDRON, TETRAHEDRON[:1])), False),
        (np.empty((0, 3), dtype=np.int64), False),
    ],
)
def test_surfaces_are_closed_where_edges_pair_up(triangles: np.ndarray, closed: bool) -> None:
    assert is_closed(triangles) == closed


@pytest.mark.parametrize("seed", range(5))
def test_winding_is_restored_with_the_fewest_reversals(seed: int) -> None:
    rng = np.random.default_rng(seed)
    _, faces = sphere()
    faces = np.vstack((faces, faces[:, ::-1] + int(faces.max()) + 1))  # two shells, one inward
    flip = rng.random(len(faces)) < 0.3
    mixed = np.where(flip[:, None], faces[:, ::-1], faces)
    assert not is_closed(mixed)
    restored = consistent_winding(mixed)
    assert restored is not None
    np.testing.assert_array_equal(restored, faces)


def test_open_and_one_sided_surfaces_have_no_winding() -> None:
    strip = np.array([[i, (i + 1) % 5, (i + 2) % 5] for i in range(5)])  # a Moebius band
    plane = np.array(
        [[0, i, i % 5 + 1] for i in range(1, 6)]
        + [[i, i % 5 + 1, (i + 2) % 5 + 1] for i in range(1, 6)]
    )  # the projective plane on six vertices: closed, one-sided
    for faces in (TETRAHEDRON[:3], strip, plane, np.empty((0, 3), dtype=np.int64)):
        assert consistent_winding(faces) is None


def test_derivatives_of_the_centroid_by_finite_differences() -> None:
    surface = bumpy_sphere(1)
    rng = np.random.default_rng(10)
    way = rng.normal(size=surface.points.shape)
    step = 1e-6
    after, before = (surface.with_points(surface.points + s * way).centroid for s in (step, -step))
    derivatives = surface.centroid_derivatives()
    expected = (after - before) / (2.0 * step)
    np.testing.assert_allclose(np.tensordot(derivatives, way, 2), expected, rtol=1e-7)


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
