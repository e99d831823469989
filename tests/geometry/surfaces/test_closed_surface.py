"""Closed surfaces are taken, repaired, refused in words, and made of more or fewer points."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, bent_capsule, bumpy_sphere, self_intersecting_sphere, surface_of
from scipy.spatial import cKDTree

from dicedesign.concave.shapes import SHAPES, shape
from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.surfaces.closed_surface import (
    decimate,
    make_surface,
    refine,
    require_dents,
)
from dicedesign.geometry.surfaces.quality import surface_quality
from dicedesign.geometry.triangles import Surface


def sphere(radius: float = 1.0, x: float = 0.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2, radius=radius).apply_translation((x, 0, 0))


def body_of(*parts: trimesh.Trimesh) -> Body:
    mesh = trimesh.util.concatenate(list(parts))
    return make_body(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="thing")


def assert_refused(body: Body, *said: str, error: type[InputError] = InputError) -> None:
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


@pytest.mark.parametrize(
    ("reverse", "note"),
    [
        (slice(None), "turned the surface, which was oriented inward"),
        (slice(7), "reversed 7 triangles that were wound against their neighbors"),
    ],
)
def test_triangles_are_turned_outward_with_a_note(reverse: slice, note: str) -> None:
    mesh = sphere()
    faces = mesh.faces.copy()
    faces[reverse] = faces[reverse, ::-1]
    surface, notes = make_surface(make_body(mesh.vertices, faces, name="thing"))
    assert notes == (note,)
    assert surface.volume == pytest.approx(mesh.volume)


def test_a_point_cloud_an_open_mesh_and_a_flat_one_are_refused() -> None:
    mesh = sphere()
    assert_refused(make_body(mesh.vertices, name="thing"), "got a point cloud")
    assert_refused(
        make_body(mesh.vertices, mesh.faces[1:], name="thing"),
        "3 edges with one triangle (the mesh is open)",
        "start: {mesh: {path: FILE, repair: true}}",
        "dicedesign repair",
    )
    flat = make_body(mesh.vertices * [1.0, 1.0, 1e-14], mesh.faces, name="thing")
    assert_refused(flat, "encloses a volume", error=DegenerateBodyError)


def test_an_edge_of_four_triangles_is_refused() -> None:
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0], [0, 0, -1.0]])
    both = np.vstack((tetrahedron, np.array([0, 1, 4, 5])[tetrahedron]))
    assert_refused(make_body(points, both, name="thing"), "1 edges with more than two triangles")


def test_a_one_sided_mesh_is_refused() -> None:
    """A Klein bottle of a grid whose seam is joined the wrong way around."""
    n = 6
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))

    def index(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        return (i % n) * n + np.where(i >= n, -j, j) % n

    a, b, c, d = index(i, j), index(i + 1, j), index(i, j + 1), index(i + 1, j + 1)
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((b, d, c), 1)))
    points = np.random.default_rng(0).normal(size=(n * n, 3))
    assert_refused(make_body(points, triangles, name="thing"), "one-sided", "not orientable")


@pytest.mark.parametrize(("radius", "x", "inside", "outside"), [(0.5, 0.0, 1, 0), (0.5, 3.0, 0, 1)])
def test_several_shells_are_refused(radius: float, x: float, inside: int, outside: int) -> None:
    body = body_of(sphere(), sphere(radius, x), sphere(0.3, -4.0))
    assert_refused(
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
    assert_refused(body, "several at 1 points (not a manifold), the first at (2, 0, 0)")


def test_a_self_intersecting_surface_is_refused() -> None:
    surface = self_intersecting_sphere()
    assert_refused(
        make_body(surface.points, surface.triangles, name="thing"),
        "a surface that does not meet itself",
        "pairs of triangles that do, the first near (",
        "repair: true",
    )


def subdivided_cube() -> Surface:
    mesh = trimesh.creation.box()
    for _ in range(3):
        mesh = mesh.subdivide()
    return surface_of(mesh)


def egg() -> Surface:
    surface = ball(3)
    return surface.with_points(
        surface.points * [1.0, 1.0, 1.4] * (1.0 + 0.1 * surface.points[:, 2:])
    )


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("build", [subdivided_cube, egg])
def test_convex_surfaces_are_sent_to_the_exact_method(build: object, scale: float) -> None:
    assert callable(build)
    surface = build()
    with pytest.raises(InputError, match="a convex one; take method"):
        require_dents(surface.with_points(scale * surface.points + 3.0 * scale))


@pytest.mark.parametrize("height", [0.0, 0.01])
def test_no_die_is_near_a_sphere(height: float) -> None:
    surface = ball(3)
    ripples = 1.0 + height * np.sin(7.0 * surface.points[:, :1])
    with pytest.raises(InputError, match="nearly a sphere"):
        require_dents(surface.with_points(surface.points * ripples))


def test_surfaces_with_dents_pass() -> None:
    for surface in (bumpy_sphere(), bent_capsule(), *(shape(name) for name in SHAPES)):
        require_dents(surface)


def torus() -> Surface:
    return surface_of(trimesh.creation.torus(2.0, 0.5, major_sections=48, minor_sections=24))


def check(surface: Surface, genus: int) -> None:
    """A surface is one that is taken as input without any repair."""
    taken, notes = make_surface(make_body(surface.points, surface.triangles))
    assert notes == ()
    assert len(taken.points) == len(surface.points)
    assert surface_quality(surface).genus == genus


@pytest.mark.parametrize("points", [600, 200, 60])
def test_a_decimated_torus_is_a_torus_of_the_wanted_size(points: int) -> None:
    pytest.importorskip("fast_simplification")
    before = torus()
    after, done = decimate(before, points)
    assert abs(len(after.points) - points) <= 1
    check(after, genus=1)
    aside = np.hypot(np.hypot(after.points[:, 0], after.points[:, 1]) - 2.0, after.points[:, 2])
    np.testing.assert_allclose(aside, 0.5, atol=0.15)
    assert done.startswith(f"decimated the surface from 1152 to {len(after.points)} points")
    change = 100 * (after.volume / before.volume - 1)
    assert f"changes the volume by {change:+.2g} %" in done


def test_fewer_points_than_a_tetrahedron_are_refused() -> None:
    with pytest.raises(InputError, match="expected at least 4 points, got 3; ask for more"):
        decimate(torus(), 3)


def test_without_the_extra_the_error_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fast_simplification", None)
    with pytest.raises(InputError, match=r"decimation: .*pip install 'dicedesign\[concave\]'"):
        decimate(torus(), 100)


def test_a_surface_that_intersects_itself_in_every_reduction_is_refused() -> None:
    pytest.importorskip("fast_simplification")
    first, second = torus(), torus()
    points = np.vstack((first.points, second.points + np.array([0.3, 0.2, 0.1])))
    both = Surface(points, np.vstack((first.triangles, second.triangles + 1152)))
    with pytest.raises(InputError, match="got none from 2304 points by any reduction; remesh"):
        decimate(both, 1500)


@pytest.mark.parametrize("points", [1153, 3000])
def test_a_refined_torus_is_the_same_torus(points: int) -> None:
    before = torus()
    after, done = refine(before, points)
    assert points <= len(after.points) <= 3 * points
    check(after, genus=1)
    assert after.volume == pytest.approx(before.volume, rel=1e-12)
    np.testing.assert_allclose(after.centroid, before.centroid, rtol=0, atol=1e-12)
    distance, _ = cKDTree(after.points).query(before.points)
    assert distance.max() < 1e-12
    assert done.startswith(f"refined the surface from 1152 to {len(after.points)} points")


def test_a_mesh_is_refined_to_solid_only() -> None:
    before = torus()
    with pytest.raises(InputError, match="NotManifold"):
        refine(Surface(before.points, before.triangles[1:]), 2000)
