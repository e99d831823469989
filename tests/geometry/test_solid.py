"""Volume and centroid against closed forms and trimesh; closedness and winding."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere
from common.paths import public_data
from scipy.spatial.transform import Rotation

from dicedesign.geometry.meshes.orientation import consistent_winding
from dicedesign.geometry.solid import is_closed, solid_properties, stretch_matrix

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def box(sides: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.box(sides)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def frustum(bottom: float, top: float, height: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """A frustum over a regular n-gon with the given circumradii, standing on z = 0."""
    angles = 2 * np.pi * np.arange(n) / n
    ring = np.column_stack((np.cos(angles), np.sin(angles)))
    points = np.vstack(
        (
            np.column_stack((bottom * ring, np.zeros(n))),
            np.column_stack((top * ring, np.full(n, height))),
        )
    )
    i, j = np.arange(n), (np.arange(n) + 1) % n
    inner = np.arange(1, n - 1)
    zero = np.zeros_like(inner)
    faces = np.vstack(
        (
            np.column_stack((i, j, j + n)),
            np.column_stack((i, j + n, i + n)),
            np.column_stack((zero, inner + 1, inner)),
            np.column_stack((zero + n, inner + n, inner + 1 + n)),
        )
    )
    return points, faces


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


def test_a_tetrahedron_has_the_mean_of_its_corners() -> None:
    corners = np.random.default_rng(3).normal(size=(4, 3))
    volume, centroid = solid_properties(corners, TETRAHEDRON)
    expected = np.linalg.det(corners[1:] - corners[0]) / 6
    assert volume == pytest.approx(expected, rel=1e-14)
    np.testing.assert_allclose(centroid, corners.mean(axis=0), rtol=0, atol=1e-15)


def test_a_box_has_its_middle() -> None:
    points, faces = box((1.0, 2.0, 3.0))
    volume, centroid = solid_properties(points + np.array([4.0, 5.0, 6.0]), faces)
    assert volume == pytest.approx(6.0, rel=1e-15)
    np.testing.assert_allclose(centroid, [4.0, 5.0, 6.0], rtol=1e-15)


@pytest.mark.parametrize(("bottom", "top"), [(1.0, 0.5), (2.0, 1.9), (0.1, 3.0)])
def test_a_frustum_has_its_closed_form(bottom: float, top: float) -> None:
    height, n = 1.7, 11
    volume, centroid = solid_properties(*frustum(bottom, top, height, n))
    polygon = n / 2 * np.sin(2 * np.pi / n)
    squares = bottom**2 + bottom * top + top**2
    above = height / 4 * (bottom**2 + 2 * bottom * top + 3 * top**2) / squares
    assert volume == pytest.approx(polygon * height * squares / 3, rel=1e-14)
    np.testing.assert_allclose(centroid, [0, 0, above], rtol=1e-14, atol=1e-15)


def test_a_cavity_counts_against_the_solid() -> None:
    points, faces = box((2.0, 2.0, 2.0))
    hole = points / 2 + np.array([0.25, 0.0, 0.0])
    both = np.vstack((faces, faces[:, ::-1] + len(points)))
    volume, centroid = solid_properties(np.vstack((points, hole)), both)
    assert is_closed(both)
    assert volume == pytest.approx(7.0)
    np.testing.assert_allclose(centroid, [-0.25 / 7, 0, 0], atol=1e-15)


def test_reversing_changes_only_the_sign_of_the_volume() -> None:
    points, faces = sphere()
    volume, centroid = solid_properties(points, faces)
    mirrored_volume, same_centroid = solid_properties(points, faces[:, ::-1])
    assert mirrored_volume == pytest.approx(-volume, rel=1e-14)
    np.testing.assert_allclose(same_centroid, centroid, rtol=0, atol=1e-15)


def test_translating_far_away_changes_the_centroid_by_rounding_only() -> None:
    points, faces = sphere()
    shift = np.array([1e7, -2e7, 3e7])
    moved = points + shift
    rounded = moved - shift  # exact, so it carries the rounding of the moved coordinates
    volume, centroid = solid_properties(moved, faces)
    expected_volume, expected = solid_properties(rounded, faces)
    spacing = np.spacing(np.abs(shift))
    assert volume == pytest.approx(expected_volume, rel=1e-12)
    assert (np.abs(centroid - shift - expected) <= 2 * spacing).all()


@pytest.mark.parametrize("scale", [1e-9, 1e9, 1e-90, 1e90])
def test_scaling_scales(scale: float) -> None:
    points, faces = sphere()
    volume, centroid = solid_properties(points, faces)
    scaled_volume, scaled_centroid = solid_properties(points * scale, faces)
    assert scaled_volume == pytest.approx(volume * scale**3, rel=1e-13)
    np.testing.assert_allclose(scaled_centroid, centroid * scale, rtol=0, atol=1e-15 * scale)


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


@pytest.mark.parametrize("factors", [[1, 1, 1e6], [1e9, 1, 1e3], [1, 1e-6, 1], [1, 1, 1e-20]])
def test_thin_bodies_along_the_axes_lose_nothing(factors) -> None:
    points, faces = sphere()
    points, before = points * factors, solid_properties(points, faces)
    volume, centroid = solid_properties(points, faces)
    assert volume == pytest.approx(before[0] * np.prod(factors), rel=1e-14)
    np.testing.assert_allclose(centroid / factors, before[1], rtol=0, atol=1e-15)


def test_only_thin_bodies_are_thickened() -> None:
    points, faces = sphere()
    points = points - points.mean(axis=0)
    volume = solid_properties(points, faces)[0]
    turn = Rotation.random(random_state=0)
    for factor, thin in ((30.0, False), (300.0, True)):
        needle = turn.apply(points * [1, 1, factor])
        matrix = stretch_matrix(needle, volume * factor)
        assert (matrix is not None) == thin
    assert matrix is not None
    image = needle @ np.linalg.inv(matrix)
    assert np.linalg.cond(image) < 3.0
    for factors in ([1, 0, 1], [1, 0, 0]):
        assert stretch_matrix(points * factors, 0.0) is None
        turned = turn.apply(points * factors)
        assert abs(solid_properties(turned, faces)[0]) < 1e-14


def test_no_volume_has_no_centroid() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 0]])
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for points in (flat, np.ones((3, 3))):
        volume, centroid = solid_properties(points, faces)
        assert volume == 0.0
        assert np.isnan(centroid).all()


@pytest.mark.parametrize("name", ["spot", "bunny", "koala", "penguin", "armadillo"])
def test_models_agree_with_trimesh(name: str) -> None:
    path = public_data(f"models/{name}.obj")
    mesh = trimesh.load_mesh(path, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    volume, centroid = solid_properties(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert volume == pytest.approx(mesh.volume, rel=1e-12)
    np.testing.assert_allclose(centroid, mesh.center_mass, rtol=0, atol=1e-12 * mesh.extents.max())


def test_closed_surfaces_are_closed() -> None:
    assert is_closed(TETRAHEDRON)
    two = np.vstack((TETRAHEDRON, TETRAHEDRON[:, ::-1] + 4))
    assert is_closed(two)
    sharing_an_edge = np.vstack((TETRAHEDRON, np.array([0, 1, 4, 5])[TETRAHEDRON]))
    assert is_closed(sharing_an_edge)


def test_open_or_inconsistent_surfaces_are_not_closed() -> None:
    assert not is_closed(TETRAHEDRON[:3])
    assert not is_closed(np.vstack((TETRAHEDRON, TETRAHEDRON[:3] + 4)))
    assert not is_closed(np.vstack((TETRAHEDRON[:3], TETRAHEDRON[3:, ::-1])))
    assert not is_closed(np.vstack((TETRAHEDRON, TETRAHEDRON[:1])))
    assert not is_closed(np.empty((0, 3), dtype=np.int64))


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


def test_a_tie_between_orientations_is_broken_consistently() -> None:
    mixed = np.vstack((TETRAHEDRON[:2], TETRAHEDRON[2:, ::-1]))
    restored = consistent_winding(mixed)
    assert restored is not None
    assert is_closed(restored)


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
    after, before = (surface.moved(surface.points + s * way).centroid for s in (step, -step))
    derivatives = surface.centroid_derivatives()
    expected = (after - before) / (2.0 * step)
    np.testing.assert_allclose(np.tensordot(derivatives, way, 2), expected, rtol=1e-7)


def test_a_centroid_moves_and_grows_with_its_surface() -> None:
    surface = bent_capsule()
    derivatives = surface.centroid_derivatives()
    np.testing.assert_allclose(derivatives.sum(axis=1), np.eye(3), atol=1e-12)
    grown = np.tensordot(derivatives, surface.points, 2)
    np.testing.assert_allclose(grown, surface.centroid, atol=1e-12)
