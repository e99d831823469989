"""Smoothly shaded surfaces, their colours, and shells of glass around them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from common.kernels import without_kernels

from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Shell, Surface, render
from dicedesign.report.render.shading import brightness, corner_normals

FRONT = Camera(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.5)
UPRIGHT = np.array([0.0, 0.0, 1.0])


def sphere(subdivisions: int) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def cube(half: float) -> trimesh.Trimesh:
    return trimesh.creation.box([2.0 * half] * 3)


def square(depth: float, half: float = 1.0) -> np.ndarray:
    corners = [[-half, -half], [half, -half], [half, half], [-half, half]]
    return np.column_stack([np.array(corners), np.full(4, depth)])


HALVES = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("subdivisions", [3, 5])
def test_corner_normals_of_a_sphere_are_radial(subdivisions: int) -> None:
    surface = sphere(subdivisions)
    normals = corner_normals(surface.points, surface.triangles)
    error = np.linalg.norm(normals - surface.points[surface.triangles], axis=-1).max()
    assert error < 0.05 * 4.0 ** (3 - subdivisions)


def test_corner_normals_keep_sharp_edges() -> None:
    box = cube(1.0)
    normals = corner_normals(box.vertices, box.faces)
    np.testing.assert_allclose(normals, np.repeat(box.face_normals[:, None], 3, axis=1), atol=1e-12)


@pytest.mark.parametrize(("degrees", "shared"), [(30.0, True), (40.0, False)])
def test_two_triangles_share_a_normal_up_to_35_degrees(degrees: float, shared: bool) -> None:
    turn = np.radians(degrees)
    points = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [np.cos(turn), 0, -np.sin(turn)]], float)
    left, right = corner_normals(points, np.array([[0, 1, 2], [0, 3, 1]]))
    middle = np.array([np.sin(turn / 2), 0.0, np.cos(turn / 2)])
    np.testing.assert_allclose(left[2], [0, 0, 1], atol=1e-12)
    for corner in (left[0], left[1], right[0], right[2]):
        assert np.allclose(corner, middle) == shared


def test_triangles_without_area_change_no_normal() -> None:
    points = np.concatenate([square(0.0), [[0.0, 0.0, 0.0]]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 2], [1, 1, 1]])
    normals = corner_normals(points, triangles)
    np.testing.assert_array_equal(normals[:2], np.broadcast_to([0.0, 0.0, 1.0], (2, 3, 3)))


def test_a_coarse_sphere_is_shaded_like_the_sphere() -> None:
    picture = render(sphere(3), FRONT, 120)
    centres = (np.arange(120) + 0.5) / 40.0 - 1.5
    x, y = np.meshgrid(centres, -centres)
    inside = x**2 + y**2 < 0.7
    normals = np.stack([x, y, np.sqrt(np.where(inside, 1.0 - x**2 - y**2, 0.0))], axis=-1)
    light = brightness(normals[inside])
    shown = picture[inside][:, 0] / 255.0
    # But for the darkening of what lies behind its surroundings, which is none in the middle.
    error = np.abs(shown / shown.max() - light / light.max())
    assert error.max() < 0.06
    flat = render(replace(sphere(3), smooth=False), FRONT, 120)[inside][:, 0] / 255.0
    assert np.abs(flat / flat.max() - light / light.max()).max() > 2.0 * error.max()


def test_both_sides_are_drawn_alike() -> None:
    surface = sphere(3)
    turned = Surface(surface.points, surface.triangles[:, ::-1])
    one, other = (render(s, FRONT, 60).astype(int) for s in (surface, turned))
    assert np.abs(one - other).max() <= 1


def test_colours_of_points_are_interpolated() -> None:
    red_to_blue = np.array([[1, 0, 0], [0, 0, 1], [0, 0, 1], [1, 0, 0]], float)
    picture = render(Surface(square(0.0), HALVES, red_to_blue), FRONT, 90)
    row = picture[45, 17:73].astype(float)
    share = row[:, 2] / row.sum(axis=1)
    np.testing.assert_allclose(share, (np.arange(17, 73) + 0.5 - 15.0) / 60.0, atol=0.02)
    assert row[:, 1].max() == 0
    # Colours do not depend on the triangle of the square that a pixel sees.
    np.testing.assert_array_equal(picture[20:70, 20], np.broadcast_to(picture[20, 20], (50, 3)))


def test_what_is_not_covered_shows_the_backdrop() -> None:
    backdrop = np.linspace(0.0, 1.0, 90)[:, None] * np.ones(90)
    picture = render(Surface(square(0.0), HALVES), FRONT, 90, backdrop=backdrop)
    np.testing.assert_array_equal(picture[:, 5, 1], np.rint(255.0 * backdrop[:, 5]))
    assert (picture[45, 45] > picture[45, 5]).all()
    nothing = Surface(square(0.0) + np.array([9.0, 0.0, 0.0]), HALVES)
    assert (render(nothing, FRONT, 20) == 255).all()


def test_silhouettes_and_steps_are_outlined_and_sharp_edges_are_not() -> None:
    points = np.concatenate([square(0.0), square(0.5, 0.5)])
    steps = Surface(points, np.concatenate([HALVES, HALVES + 4]))
    picture = render(steps, FRONT, 90)
    inner = picture[45, 45]
    # Where the squares' borders are: 15 and 30 pixels from the left.
    assert (picture[45, 29:31].astype(int) < inner.astype(int) - 40).all()
    assert picture[45, 15].max() < inner.max() - 40
    box = cube(1.0)
    corner = Camera(np.ones(3), UPRIGHT, np.zeros(3), 2.0)
    solid = Surface(np.asarray(box.vertices), np.asarray(box.faces))
    plain = render(replace(solid, smooth=False), corner, 90)
    smooth = render(solid, corner, 90)
    assert plain[45, 45].max() < 80
    assert smooth[45, 45].max() > 85


def test_slivers_are_harmless() -> None:
    points = np.array([[0, -1, 0], [0, 1, 0], [1e-9, 0, 0], [0.0, 0.5, 0.0]])
    picture = render(Surface(points, np.array([[0, 1, 2], [0, 1, 3]])), FRONT, 31)
    assert picture.shape == (31, 31, 3)


def glass(tinted: tuple[int, ...]) -> Shell:
    """A cube; facet 0 is toward -x, by trimesh's order of triangles."""
    box = cube(1.2)
    tints = np.full((len(box.faces), 3), np.nan)
    for axis in tinted:
        facing = box.face_normals[:, 2] == axis
        tints[facing] = [0.0, 0.8, 0.0]
    return Shell(np.asarray(box.vertices), np.asarray(box.faces), tints)


def test_a_shell_tints_what_is_behind_it() -> None:
    surface = Surface(square(0.0, 0.5), HALVES)
    bare = render(surface, FRONT, 90).astype(int)
    clear, near, far = (
        render(surface, FRONT, 90, glass(tinted)).astype(int) for tinted in ((), (1,), (-1,))
    )
    # The surface is seen through the glass and grows greener only where the near side is tinted.
    assert np.abs(clear[45, 40] - bare[45, 40]).max() < 40
    green = [picture[..., 1] - picture[..., 0] for picture in (clear, near, far)]
    assert green[1][45, 40] > green[0][45, 40] + 50
    assert green[2][45, 40] == green[0][45, 40]
    # Beside the surface both sides show, the far one paler.
    assert green[0][45, 20] < 20
    assert green[1][45, 20] > green[2][45, 20] + 20 > 40
    # Outside of the shell there is nothing.
    assert all((picture[45, 4] == 255).all() for picture in (clear, near, far))


def test_edges_of_a_shell_are_drawn_but_not_across_its_flat_facets() -> None:
    nothing = Surface(square(0.0, 1e-4), HALVES)
    picture = render(nothing, FRONT, 90, glass(())).astype(int)
    inside = picture[12:40, 12:78]
    assert np.ptp(inside.reshape(-1, 3), axis=0).max() == 0
    assert picture[45, 9].max() < inside[0, 0].max() - 20


def test_pictures_are_the_same_without_the_kernel() -> None:
    surface = sphere(3)
    expected = render(surface, FRONT, 60, glass((1,)))
    with without_kernels():
        np.testing.assert_array_equal(render(surface, FRONT, 60, glass((1,))), expected)
