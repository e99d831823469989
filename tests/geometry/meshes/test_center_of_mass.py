"""The default center of mass, the requested one, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.meshes.body import make_body, resolve_center_of_mass

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
