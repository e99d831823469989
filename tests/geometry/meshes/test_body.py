"""Bodies of points and triangles: welding, orientation, shells, and the center of mass."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.kernels import compiled_only, without_kernels

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.meshes.body import (
    body_of,
    distinct_triangles,
    is_rounded,
    make_body,
    outward_patches,
    resolve_center_of_mass,
    shells_of,
)
from dicedesign.geometry.triangles import Surface, is_closed
from dicedesign.runtime.arrays import Integers

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def test_float32_counts_as_single_precision_and_integers_do_not() -> None:
    assert make_body(np.array(CORNERS, dtype=np.float32)).single_precision
    assert make_body(np.array(CORNERS, dtype=np.float16)).single_precision
    assert not make_body(CORNERS).single_precision
    assert not make_body(np.array(CORNERS, dtype=np.float64)).single_precision
    assert make_body(CORNERS, single_precision=True).single_precision


@pytest.mark.parametrize("digits", [1, 6, 11, 12, 13, 15])
def test_decimal_digits_are_counted_at_every_magnitude(digits: int) -> None:
    rng = np.random.default_rng(digits)
    numbers = rng.integers(10 ** (digits - 1), 10**digits, size=(400, 3))
    numbers[:, 0] -= numbers[:, 0] % 10 - 1  # no trailing zero
    for exponent in (-300, -40, -23, -22, -12, -6, 0, 3, 20, 250):
        points = np.array([[float(f"{n}e{exponent}") for n in row] for row in numbers.tolist()])
        assert is_rounded(points) == (digits <= 12), exponent
        assert is_rounded(-points) == (digits <= 12), exponent


def test_welding_keeps_the_first_of_equal_positions_and_ignores_the_sign_of_zero() -> None:
    points = np.array([[2.0, 0, 0], [1, 0, 0], [2, -0.0, 0], [1, 0, 1e-300], [1, 0, 0], [0, 1, 0]])
    body = make_body(points, np.array([[0, 1, 3], [2, 4, 3], [0, 2, 3], [5, 1, 2]]))
    np.testing.assert_array_equal(body.points, points[[0, 1, 3, 5]])
    np.testing.assert_array_equal(body.triangles, [[0, 1, 2], [0, 1, 2], [3, 1, 0]])
    assert len(make_body(points).points) == 4


def test_stray_points_and_collapsed_triangles_are_dropped_with_a_note() -> None:
    points = [*CORNERS, [9, 9, 9], [0, 0, 0]]
    body = make_body(points, [*TETRAHEDRON, [0, 1, 5]])
    np.testing.assert_array_equal(body.points, CORNERS)
    np.testing.assert_array_equal(body.triangles, TETRAHEDRON)
    assert body.notes == (
        "ignored 1 points that are on no triangle",
        "welded 1 points to others at equal positions",
        "dropped 1 triangles with a repeated corner",
    )


HULL_CENTROID = np.array([0.1, 0.2, 0.3])


def cone() -> tuple[np.ndarray, np.ndarray]:
    """A pyramid over a 16-gon standing on z = 0, of height 2: its centroid is at z = 1/2."""
    mesh = trimesh.creation.cone(radius=1.0, height=2.0, sections=16)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def test_mixed_windings_are_repaired_with_a_note() -> None:
    points, faces = cone()
    mixed = faces.copy()
    mixed[[0, 3, 5]] = mixed[[0, 3, 5], ::-1]
    for triangles in (mixed, mixed[:, ::-1]):
        body = make_body(points, triangles)
        center, source, notes = resolve_center_of_mass(body, HULL_CENTROID)
        np.testing.assert_allclose(center, [0, 0, 0.5], atol=1e-14)
        assert source == "uniform solid"
        assert notes == ("reversed 3 triangles that were wound against their neighbors",)


def test_an_open_mesh_and_points_take_the_hull() -> None:
    points, faces = cone()
    for triangles, note in [
        (faces[1:], "the mesh is not closed"),
        (None, "the body has no triangles"),
    ]:
        center, source, notes = resolve_center_of_mass(make_body(points, triangles), HULL_CENTROID)
        np.testing.assert_array_equal(center, HULL_CENTROID)
        assert source == "uniform solid hull"
        assert notes == (note,)


def doubled_sheet() -> tuple[np.ndarray, np.ndarray]:
    points, faces = cone()
    half = faces[: len(faces) // 2]
    return points, np.vstack((half, half[:, ::-1]))


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_closed_mesh_without_volume_is_refused(scale: float) -> None:
    points, faces = doubled_sheet()
    body = make_body(points * scale, faces, name="sheet.stl")
    message = r"^sheet\.stl: expected a closed mesh that encloses .*--com x,y,z\b.*--com hull$"
    with pytest.raises(DegenerateBodyError, match=message):
        resolve_center_of_mass(body, HULL_CENTROID)
    assert resolve_center_of_mass(body, HULL_CENTROID, "hull")[1] == "uniform solid hull"


Mesh = tuple[np.ndarray, np.ndarray]


def box(size: float, center: float, inward: bool = False) -> Mesh:
    mesh = trimesh.creation.box((size, size, size))
    faces = np.asarray(mesh.faces)
    return mesh.vertices + np.array([center, 0.0, 0.0]), faces[:, ::-1] if inward else faces


def join(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(points) for points, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts[:-1], strict=True)]
    return np.concatenate([points for points, _ in meshes]), np.concatenate(faces)


TURNED = "turned {} shells that lie beside others and were oriented against them"


@pytest.mark.parametrize(
    ("meshes", "center", "turned"),
    [
        ((box(2, 0), box(1, 3, inward=True)), 3 / 9, 1),
        ((box(2, 0), box(1, 3)), 3 / 9, 0),
        ((box(2, 0), box(1, 0.25, inward=True)), -0.25 / 7, 0),
        ((box(2, 0), box(1, 0.5, inward=True)), -0.5 / 7, 0),  # a face of the hole on the surface
        ((box(2, 0), box(1, 1.5, inward=True)), 1.5 / 9, 1),  # a face on the other's face
        ((box(2, 0), box(2, 5, inward=True)), 2.5, 1),
        ((box(4, 0), box(3, 0, inward=True), box(2, 0), box(1, 0.25, inward=True)), -0.25 / 44, 0),
        ((box(2, 0), box(1, 3, inward=True), box(1, 5, inward=True)), 8 / 10, 2),
    ],
)
def test_inward_shells_are_cavities_only_inside_others(
    meshes: tuple[Mesh, ...], center: float, turned: int
) -> None:
    body = make_body(*join(*meshes))
    point, source, notes = resolve_center_of_mass(body, HULL_CENTROID)
    np.testing.assert_allclose(point, [center, 0, 0], atol=1e-14)
    assert source == "uniform solid"
    assert [note for note in notes if "shells" in note] == [TURNED.format(turned)] * bool(turned)


def soups() -> list[Integers]:
    """Triangles that meet at random, spheres, pairs of them, and spheres with a hole."""
    rng = np.random.default_rng(0)
    soups_of_triangles = []
    for size in range(2, 60):
        corners = rng.integers(0, size, size=(size, 3))
        distinct = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
        if distinct.any():
            soups_of_triangles.append(corners[distinct])
    sphere = np.asarray(trimesh.creation.icosphere(subdivisions=2).faces, dtype=np.int64)
    two = np.concatenate([sphere, sphere[:, ::-1] + sphere.max() + 1])
    soups_of_triangles += [sphere, two, two[rng.permutation(len(two))], sphere[1:], sphere[:, ::-1]]
    return soups_of_triangles


@compiled_only
def test_kernels_find_the_shells_and_the_closed_surfaces_that_numpy_finds() -> None:
    answers = []
    for triangles in soups():
        shells = shells_of(triangles)
        answers.append(is_closed(triangles))
        with without_kernels():
            np.testing.assert_array_equal(shells, shells_of(triangles))
            assert is_closed(triangles) == answers[-1]
    assert answers[-5:] == [True, True, True, False, True]


SPHERE = trimesh.creation.icosphere(subdivisions=2)
POINTS = np.asarray(SPHERE.vertices)
OUTWARD = np.asarray(SPHERE.faces, dtype=np.int64)


def rows(triangles: np.ndarray) -> set[tuple[int, ...]]:
    """Triangles, from their lowest corner on."""
    turned = [np.roll(row, -int(row.argmin())) for row in triangles]
    return {tuple(int(corner) for corner in row) for row in turned}


def test_one_of_repeated_triangles_is_kept_whatever_its_first_corner() -> None:
    rng = np.random.default_rng(0)
    again = np.roll(OUTWARD[rng.integers(0, len(OUTWARD), 500)], 1, axis=1)
    mixed = rng.permutation(np.concatenate([OUTWARD, again]))
    distinct = distinct_triangles(mixed)
    assert len(distinct) == len(OUTWARD)
    assert rows(distinct) == rows(OUTWARD)


def test_double_walls_are_removed_and_triangles_with_more_copies_on_one_side_stay() -> None:
    wall = np.array([[0, 5, 9]])
    mixed = np.concatenate([wall, OUTWARD, wall[:, ::-1], OUTWARD[:3, ::-1], OUTWARD[:3]])
    assert rows(distinct_triangles(mixed)) == rows(OUTWARD)


def test_a_surface_with_two_sides_keeps_one() -> None:
    both = np.concatenate([OUTWARD, OUTWARD[:, ::-1]])
    assert rows(distinct_triangles(both[:-4])) == rows(OUTWARD)


def test_closed_and_nearly_closed_patches_are_turned_outward() -> None:
    shells = [POINTS, 0.5 * POINTS, POINTS + np.array([3.0, 0.0, 0.0])]
    count = len(POINTS)
    triangles = np.concatenate([OUTWARD, OUTWARD[:, ::-1] + count, OUTWARD[2:, ::-1] + 2 * count])
    reversed_too = np.random.default_rng(1).random(len(triangles)) < 0.1
    given = np.where(reversed_too[:, None], triangles[:, ::-1], triangles)
    turned = outward_patches(np.concatenate(shells), given)
    wanted = np.concatenate([OUTWARD, OUTWARD + count, OUTWARD[2:] + 2 * count])
    assert rows(turned) == rows(wanted)
    assert is_closed(turned[: 2 * len(OUTWARD)])


@pytest.mark.parametrize(
    ("body", "name"),
    [
        (Surface(np.array(CORNERS, dtype=np.float64), np.array(TETRAHEDRON)), "mesh"),
        (trimesh.Trimesh(CORNERS, TETRAHEDRON), "mesh"),
        (CORNERS, "points"),
    ],
)
def test_messages_about_a_body_have_its_name(body: object, name: str) -> None:
    assert body_of(body).name == name
    assert body_of(body, "duck").name == body_of(body_of(body, "duck"), "swan").name == "duck"
