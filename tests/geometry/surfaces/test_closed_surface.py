"""Every way in which a mesh is no surface of one solid is named, and what can be repaired is."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import pushed_through
from common.paths import public_data

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.surfaces.closed_surface import make_surface


def sphere(radius: float = 1.0, x: float = 0.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2, radius=radius).apply_translation((x, 0, 0))


def body_of(*parts: trimesh.Trimesh) -> Body:
    mesh = trimesh.util.concatenate(list(parts))
    return make_body(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="thing")


def refused(body: Body, *said: str, error: type[InputError] = InputError) -> None:
    with pytest.raises(error) as raised:
        make_surface(body)
    message = str(raised.value)
    assert message.startswith("thing: expected ")
    for part in (*said, "; "):
        assert part in message


def test_a_good_surface_is_taken_as_it_is() -> None:
    body = body_of(sphere())
    surface, notes = make_surface(body)
    assert notes == ()
    np.testing.assert_array_equal(surface.points, body.points)
    np.testing.assert_array_equal(surface.triangles, body.triangles)
    assert surface.volume > 4.0


def test_an_inward_surface_is_turned() -> None:
    mesh = sphere()
    surface, notes = make_surface(make_body(mesh.vertices, mesh.faces[:, ::-1], name="thing"))
    assert notes == ("turned the surface, which was oriented inward",)
    assert surface.volume == pytest.approx(mesh.volume)


def test_triangles_against_their_neighbors_are_reversed() -> None:
    mesh = sphere()
    faces = mesh.faces.copy()
    faces[:7] = faces[:7, ::-1]
    surface, notes = make_surface(make_body(mesh.vertices, faces, name="thing"))
    assert notes == ("reversed 7 triangles that were wound against their neighbors",)
    assert surface.volume == pytest.approx(mesh.volume)


def test_points_on_no_triangle_are_dropped() -> None:
    mesh = sphere()
    points = np.vstack((np.full((1, 3), 9.0), mesh.vertices))
    body = Body(points, np.asarray(mesh.faces, dtype=np.int64) + 1, "thing", False, ())
    surface, notes = make_surface(body)
    assert notes == ("dropped 1 points that are on no triangle",)
    np.testing.assert_array_equal(surface.points, mesh.vertices)
    np.testing.assert_array_equal(surface.triangles, mesh.faces)


def test_notes_of_the_body_come_first() -> None:
    mesh = sphere()
    points = np.vstack((mesh.vertices, np.full((1, 3), 9.0)))
    _, notes = make_surface(make_body(points, mesh.faces[:, ::-1], name="thing"))
    assert [note.split()[0] for note in notes] == ["ignored", "turned"]


def test_a_point_cloud_is_refused() -> None:
    refused(make_body(sphere().vertices, name="thing"), "got a point cloud")


def test_an_open_mesh_is_refused() -> None:
    mesh = sphere()
    refused(
        make_body(mesh.vertices, mesh.faces[1:], name="thing"),
        "3 edges with one triangle (the mesh is open)",
        "start: {mesh: {path: FILE, repair: true}}",
        "dicedesign repair",
    )


def test_an_edge_of_four_triangles_is_refused() -> None:
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0], [0, 0, -1.0]])
    both = np.vstack((tetrahedron, np.array([0, 1, 4, 5])[tetrahedron]))
    refused(make_body(points, both, name="thing"), "1 edges with more than two triangles")


def test_a_one_sided_mesh_is_refused() -> None:
    """A Klein bottle of a grid whose seam is joined the wrong way around."""
    n = 6
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))

    def index(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        return (i % n) * n + np.where(i >= n, -j, j) % n

    a, b, c, d = index(i, j), index(i + 1, j), index(i, j + 1), index(i + 1, j + 1)
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((b, d, c), 1)))
    points = np.random.default_rng(0).normal(size=(n * n, 3))
    refused(make_body(points, triangles, name="thing"), "one-sided", "not orientable")


@pytest.mark.parametrize(("radius", "x", "inside", "outside"), [(0.5, 0.0, 1, 0), (0.5, 3.0, 0, 1)])
def test_several_shells_are_refused(radius: float, x: float, inside: int, outside: int) -> None:
    body = body_of(sphere(), sphere(radius, x), sphere(0.3, -4.0))
    refused(
        body,
        "got 3 shells: the largest of 320 triangles",
        f"{inside} inside it (cavities or parts) and {outside + 1} outside",
        "keep one shell",
    )


def test_two_sheets_at_a_point_are_refused() -> None:
    """A torus whose tube is pinched to one point."""
    mesh = trimesh.creation.torus(2.0, 0.5, major_sections=24, minor_sections=12)
    ring = np.arange(12)
    points = np.asarray(mesh.vertices).copy()
    assert np.ptp(np.arctan2(points[ring, 1], points[ring, 0])) < 1e-6
    faces = np.where(np.isin(mesh.faces, ring), 0, mesh.faces)
    points[0] = (2.0, 0.0, 0.0)
    body = make_body(points, faces, name="thing")
    refused(body, "several at 1 points (not a manifold), the first at (2, 0, 0)")


def test_a_surface_that_meets_itself_is_refused() -> None:
    surface = pushed_through()
    refused(
        make_body(surface.points, surface.triangles, name="thing"),
        "a surface that does not meet itself",
        "pairs of triangles that do, the first near (",
        "repair: true",
    )


def test_a_surface_without_volume_is_refused() -> None:
    mesh = sphere()
    flat = mesh.vertices * [1.0, 1.0, 1e-14] + [0, 0, 0]
    refused(
        make_body(flat, mesh.faces, name="thing"),
        "encloses a volume",
        error=DegenerateBodyError,
    )


@pytest.mark.parametrize("name", ["spot", "penguin", "koala", "bunny", "armadillo"])
def test_models_are_good(name: str) -> None:
    path = public_data(f"models/{name}.obj")
    surface, _ = make_surface(read_body(path))
    assert surface.volume > 0


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_a_tilted_sheet_is_told_to_be_flat(scale: float) -> None:
    tilt = np.array([[0.6, 0.8, 0.0], [0.0, 0.6, 0.8]])
    points = scale * (np.random.default_rng(0).normal(size=(40, 2)) @ tilt + [5.0, 1.0, -3.0])
    triangles = np.arange(39).reshape(-1, 3)
    body = make_body(points, triangles, name="thing")
    refused(body, "encloses a volume", "flat sheet", error=DegenerateBodyError)
