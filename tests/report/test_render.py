"""The renderer: silhouettes, depths, shading, glass and shadows, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from common.kernels import without_kernels

from dicedesign.report.raster import Camera, rasterize
from dicedesign.report.renderer import (
    RenderMesh,
    brightness,
    render,
)

FRONT = Camera(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.5)


def visible_from(vertices, triangles, camera, size):
    return rasterize(camera.pixel_positions(vertices, size), triangles, size)


def test_silhouette_and_depth_of_a_sphere():
    sphere = trimesh.creation.icosphere(subdivisions=5)
    visible, depth = visible_from(sphere.vertices, sphere.faces, FRONT, 300)
    assert (visible >= 0).sum() / 100.0**2 == pytest.approx(np.pi, rel=2e-3)
    centers = (np.arange(300) + 0.5) / 100.0 - 1.5
    squared = np.square(centers)[:, None] + np.square(centers)
    inside = squared < 0.9
    np.testing.assert_allclose(depth[inside] / 100.0, np.sqrt(1.0 - squared[inside]), atol=2e-3)


def test_triangles_with_common_edges_leave_no_gap_and_do_not_overlap():
    rng = np.random.default_rng(4)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 40))
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(40)], axis=1)
    points = np.concatenate([rng.uniform(-0.2, 0.2, (1, 3)) * [1, 1, 0], rim])
    fan = np.array([[0, 1 + k, 1 + (k + 1) % 40] for k in range(40)])
    together, _ = visible_from(points, fan, FRONT, 200)
    counts = sum(
        (visible_from(points, fan[[k]], FRONT, 200)[0] >= 0).astype(int) for k in range(40)
    )
    assert counts.max() == 1
    np.testing.assert_array_equal(counts == 1, together >= 0)


def test_the_kernel_sees_the_triangles_that_numpy_sees() -> None:
    rng = np.random.default_rng(0)
    for case in range(60):
        count = int(rng.integers(3, 60))
        positions = rng.normal(size=(count, 3)) * rng.choice([5, 30, 200]) + rng.choice([0, 20, 50])
        if case % 3 == 0:
            # Corners and edges on pixels' centers, equal depths.
            positions = np.round(positions) + 0.5
        triangles = rng.integers(0, count, size=(80, 3))
        visible, depth = rasterize(positions, triangles, 64)
        with without_kernels():
            expected = rasterize(positions, triangles, 64)
        np.testing.assert_array_equal(visible, expected[0])
        np.testing.assert_array_equal(depth, expected[1])


def sphere(subdivisions: int) -> RenderMesh:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return RenderMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def square(depth: float, half: float = 1.0) -> np.ndarray:
    corners = [[-half, -half], [half, -half], [half, half], [-half, half]]
    return np.column_stack([np.array(corners), np.full(4, depth)])


HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def test_a_coarse_sphere_is_shaded_like_the_sphere() -> None:
    picture = render(sphere(3), FRONT, 120)
    centers = (np.arange(120) + 0.5) / 40.0 - 1.5
    x, y = np.meshgrid(centers, -centers)
    inside = x**2 + y**2 < 0.7
    normals = np.stack([x, y, np.sqrt(np.where(inside, 1.0 - x**2 - y**2, 0.0))], axis=-1)
    light = brightness(normals[inside])
    shown = picture[inside][:, 0] / 255.0
    # But for the darkening of what lies behind its surroundings, which is none in the middle.
    error = np.abs(shown / shown.max() - light / light.max())
    assert error.max() < 0.06
    flat = render(replace(sphere(3), smooth=False), FRONT, 120)[inside][:, 0] / 255.0
    assert np.abs(flat / flat.max() - light / light.max()).max() > 2.0 * error.max()


def test_colors_of_points_are_interpolated() -> None:
    red_to_blue = np.array([[1, 0, 0], [0, 0, 1], [0, 0, 1], [1, 0, 0]], float)
    picture = render(RenderMesh(square(0.0), HALVES, red_to_blue), FRONT, 90)
    row = picture[45, 17:73].astype(float)
    share = row[:, 2] / row.sum(axis=1)
    np.testing.assert_allclose(share, (np.arange(17, 73) + 0.5 - 15.0) / 60.0, atol=0.02)
    assert row[:, 1].max() == 0
    # Colors do not depend on the triangle of the square that a pixel sees.
    np.testing.assert_array_equal(picture[20:70, 20], np.broadcast_to(picture[20, 20], (50, 3)))


def test_uncovered_pixels_show_the_backdrop() -> None:
    backdrop = np.linspace(0.0, 1.0, 90)[:, None] * np.ones(90)
    picture = render(RenderMesh(square(0.0), HALVES), FRONT, 90, backdrop=backdrop)
    np.testing.assert_array_equal(picture[:, 5, 1], np.rint(255.0 * backdrop[:, 5]))
    assert (picture[45, 45] > picture[45, 5]).all()


@pytest.mark.parametrize(("rise", "height", "is_outlined"), [(0.0, 0.004, False), (0.2, 0.2, True)])
def test_slivers_between_parts_of_a_plane_have_no_outlines(
    rise: float, height: float, is_outlined: bool
) -> None:
    """A ridge narrower than a sample, as where cuts leave slivers; and a true step."""
    across = np.array([[-1.0, 0.0], [0.0, 0.0], [0.004, height], [0.008, rise], [1.0, rise]])
    points = np.array([(x, y, z) for x, z in across for y in (-1.0, 1.0)])
    strips = [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(4)]
    triangles = np.array([t for a, b, c, d in strips for t in ((a, b, c), (a, c, d))])
    picture = render(RenderMesh(points, triangles, smooth=False), FRONT, 120)
    middle = picture[60, 30:90, 0].astype(int)
    assert (middle.min() < 0.6 * np.median(middle)) == is_outlined


@pytest.mark.parametrize("smooth", [False, True])
def test_a_step_between_parallel_faces_is_outlined(smooth: bool) -> None:
    """On both sides: also on the upper square, which no recess darkens; its edges are half a unit
    from the middle, at pixels 40 and 80."""
    points = np.concatenate([square(0.0), square(0.5) * [0.5, 0.5, 1.0]])
    surface = RenderMesh(points, np.concatenate([HALVES, HALVES + 4]), smooth=smooth)
    row = render(surface, FRONT, 120)[60, :, 0]
    assert row[[40, 79]].max() < 0.8 * row[44:76].min()
