"""The rasterizer, shading and views."""

from __future__ import annotations

import time

import numpy as np
import pytest
import trimesh
from common.kernels import without_kernels

from dicedesign.fabricate.engraving import engrave
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import place_labels
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.report.render.raster import Camera, rasterize
from dicedesign.report.render.renderer import Surface, render


def render_view(points: np.ndarray, triangles: np.ndarray, camera: Camera, size: int) -> np.ndarray:
    """Picture of a solid with flat faces."""
    return render(Surface(np.asarray(points), np.asarray(triangles), smooth=False), camera, size)


FRONT = Camera(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.5)
CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def engraved_cube():
    hull = convex_hull(10.0 * CUBE)
    facets = range(6)
    polygons = [hull.polygon(facet) for facet in facets]
    options = EngravingOptions()
    texts = ["1", "2", "3", "4", "5", "7"]
    labels = place_labels(texts, polygons, hull.normals, facets, options, hull.diameter)
    return engrave(hull.vertices, hull.triangles, labels, options), hull, labels


def seen_by(vertices, triangles, camera, size):
    return rasterize(camera.pixel_positions(vertices, size), triangles, size)


@pytest.mark.parametrize("direction", [(0, 0, 1), (1, 2, -3), (-1, 0.1, 0.2)])
def test_silhouette_of_a_sphere(direction):
    sphere = trimesh.creation.icosphere(subdivisions=5)
    camera = Camera(np.array(direction, float), np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.25)
    seen, _ = seen_by(sphere.vertices, sphere.faces, camera, 400)
    area = (seen >= 0).sum() * (2.5 / 400) ** 2
    assert area == pytest.approx(np.pi, rel=2e-3)


def test_depth_is_that_of_the_surface():
    sphere = trimesh.creation.icosphere(subdivisions=5)
    _, depth = seen_by(sphere.vertices, sphere.faces, FRONT, 300)
    centres = (np.arange(300) + 0.5) / 100.0 - 1.5
    squared = np.square(centres)[:, None] + np.square(centres)
    inside = squared < 0.9
    np.testing.assert_allclose(depth[inside] / 100.0, np.sqrt(1.0 - squared[inside]), atol=2e-3)


@pytest.mark.parametrize("order", [1, -1])
def test_a_nearer_triangle_hides_a_farther_one(order):
    near = np.array([[-1, -1, 0.5], [1, -1, 0.5], [0, 1, 0.5]])
    far = near * [1.3, 1.3, 1.0] - [0, 0, 1.0]
    triangles = np.array([[0, 1, 2], [3, 4, 5]])[::order]
    seen, _ = seen_by(np.concatenate([near, far]), triangles, FRONT, 90)
    front = 0 if order == 1 else 1
    assert seen[45, 45] == front
    assert (seen == front).sum() == pytest.approx(2.0 * 30**2, rel=0.02)
    assert (seen == 1 - front).sum() == pytest.approx(0.69 * 2.0 * 30**2, rel=0.04)


def test_crossing_triangles_each_show_their_nearer_part():
    rising = np.array([[-1, -1, -1], [1, -1, 1], [1, 1, 1], [-1, 1, -1]], dtype=float)
    points = np.concatenate([rising, rising * [1, 1, -1]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    seen, _ = seen_by(points, triangles, FRONT, 60)
    assert set(seen[30, 12:28]) <= {2, 3}
    assert set(seen[30, 32:48]) <= {0, 1}


def test_triangles_with_common_edges_leave_no_gap_and_do_not_overlap():
    rng = np.random.default_rng(4)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 40))
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(40)], axis=1)
    points = np.concatenate([rng.uniform(-0.2, 0.2, (1, 3)) * [1, 1, 0], rim])
    fan = np.array([[0, 1 + k, 1 + (k + 1) % 40] for k in range(40)])
    together, _ = seen_by(points, fan, FRONT, 200)
    counts = sum((seen_by(points, fan[[k]], FRONT, 200)[0] >= 0).astype(int) for k in range(40))
    assert counts.max() == 1
    np.testing.assert_array_equal(counts == 1, together >= 0)


def test_triangles_outside_and_without_area_are_harmless():
    points = np.array([[9.0, 9, 0], [10, 9, 0], [9, 10, 0], [0, 0, 0], [0, 0, 1], [0, 0, 2]])
    picture = render_view(points, np.array([[0, 1, 2], [3, 4, 5]]), FRONT, 30)
    assert (picture == 255).all()


def test_a_picture_larger_than_the_view_is_filled():
    points = 100.0 * np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]])
    seen, _ = seen_by(points, np.array([[0, 1, 2]]), FRONT, 20)
    assert (seen == 0).all()


def test_upward_and_rightward():
    dot = np.array([[0.9, 0.9, 0.0], [1.1, 0.9, 0.0], [1.0, 1.1, 0.0]])
    picture = render_view(dot, np.array([[0, 1, 2]]), FRONT, 30)
    rows, columns = np.nonzero((picture < 255).any(axis=2))
    assert rows.max() < 10
    assert columns.min() > 20


def test_background_is_white_and_edges_are_dark():
    hull = convex_hull(CUBE)
    camera = Camera(np.ones(3), np.array([0.0, 0.0, 1.0]), np.zeros(3), 2.0)
    picture = render_view(hull.vertices, hull.triangles, camera, 100)
    assert picture.shape == (100, 100, 3)
    assert picture.dtype == np.uint8
    assert (picture[0, 0] == 255).all()
    assert picture[50, 50].max() < 80
    assert picture[35, 35].min() > 90


def test_coplanar_triangles_are_not_outlined():
    hull = convex_hull(CUBE)
    picture = render_view(hull.vertices, hull.triangles, FRONT, 60)
    inside = picture[15:45, 15:45]
    assert np.ptp(inside.reshape(-1, 3), axis=0).max() == 0


def test_an_engraved_pocket_is_seen():
    die, hull, labels = engraved_cube()
    normal, up = hull.normals[0], labels[0].frame[:3, 1]
    camera = Camera(normal, up, np.zeros(3), 10.0)
    plain = render_view(hull.vertices, hull.triangles, camera, 100)
    cut = render_view(die.points, die.triangles, camera, 100)
    changed = (plain != cut).any(axis=2)
    assert 0.03 < changed.mean() < 0.4
    assert cut[changed].mean() < plain[changed].mean() - 15
    # The 1 stands upright in the middle of its facet.
    rows, columns = np.nonzero(changed[20:80, 20:80])
    assert np.ptp(rows) > np.ptp(columns)


def test_views_of_ten_thousand_triangles_are_fast():
    sphere = trimesh.creation.icosphere(subdivisions=5)
    assert len(sphere.faces) > 10_000
    started = time.process_time()
    for k in range(6):
        direction = np.array([np.cos(k), np.sin(k), 0.3])
        camera = Camera(direction, np.array([0.0, 0.0, 1.0]), np.zeros(3), 1.1)
        render_view(sphere.vertices, sphere.faces, camera, 400)
    assert time.process_time() - started < 3.0


def test_the_kernel_sees_the_triangles_that_numpy_sees() -> None:
    rng = np.random.default_rng(0)
    for case in range(60):
        count = int(rng.integers(3, 60))
        positions = rng.normal(size=(count, 3)) * rng.choice([5, 30, 200]) + rng.choice([0, 20, 50])
        if case % 3 == 0:
            # Corners and edges on pixels' centres, equal depths.
            positions = np.round(positions) + 0.5
        triangles = rng.integers(0, count, size=(80, 3))
        seen, depth = rasterize(positions, triangles, 64)
        with without_kernels():
            expected = rasterize(positions, triangles, 64)
        np.testing.assert_array_equal(seen, expected[0])
        np.testing.assert_array_equal(depth, expected[1])
