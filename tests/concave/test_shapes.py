"""Built-in surfaces and their parts."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from dicedesign.concave.shapes import (
    SHAPES,
    blend,
    ellipsoid,
    level_set,
    mirror,
    round_cone,
    shape,
    stretch,
    tube,
)
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface


@pytest.fixture(scope="module", params=sorted(SHAPES))
def named_shape(request) -> tuple[str, Surface]:
    return request.param, shape(request.param)


def mesh_of(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.points, surface.triangles, process=False)


def test_surfaces_are_closed_outward_and_of_known_genus(named_shape):
    name, surface = named_shape
    mesh = mesh_of(surface)
    assert surface.points.dtype == np.float64
    assert surface.triangles.dtype == np.int64
    assert np.array_equal(np.unique(surface.triangles), np.arange(len(surface.points)))
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.euler_number == 2 - 2 * {"dragon": 0, "duck": 0, "kitten": 0, "knot": 1}[name]
    assert surface.volume > 0.0
    assert surface.volume == pytest.approx(mesh.volume, rel=1e-9)
    # Triangles without slivers and self-intersections, of a suitable size.
    assert 1000 <= len(surface.points) <= 3600
    assert 2.0 < np.ptp(surface.points, axis=0).max() < 3.5
    assert np.degrees(mesh.face_angles.min()) > 14.0
    assert mesh.edges_unique_length.std() < 0.33 * mesh.edges_unique_length.mean()
    assert len(intersecting_triangles(surface.points, surface.triangles)) == 0
    assert shape(name).points.tobytes() == surface.points.tobytes()


def test_a_level_set_matches_its_surface_and_volume():
    low, high = np.full(3, -1.4), np.full(3, 1.4)
    surface = level_set(ellipsoid((0.1, 0.0, -0.1), (1.2, 0.9, 0.7)), low, high, 0.1)
    offsets = (surface.points - (0.1, 0.0, -0.1)) / (1.2, 0.9, 0.7)
    assert np.linalg.norm(offsets, axis=1) == pytest.approx(1.0, abs=5e-3)
    assert surface.volume == pytest.approx(4.0 / 3.0 * np.pi * 1.2 * 0.9 * 0.7, rel=0.01)
    assert mesh_of(surface).euler_number == 2


def test_distances_of_simple_parts_are_exact_outside():
    cone = round_cone((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), 0.5, 0.5)
    points = np.array([[1.0, 3.0, 0.0], [-3.0, 0.0, 0.0], [5.0, 4.0, 0.0], [1.0, 0.0, 0.0]])
    assert cone(points) == pytest.approx([2.5, 2.5, 4.5, -0.5])
    bent = tube([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 2.0, 0.0)], 0.5, 0.5)
    assert bent(np.array([[1.0, -3.0, 0.0], [5.0, 1.0, 0.0]])) == pytest.approx([2.5, 2.5])
    ball = ellipsoid((1.0, 2.0, 3.0), (2.0, 2.0, 2.0), 30.0, 40.0)
    assert ball(np.array([[1.0, 2.0, 8.0], [1.0, 2.0, 3.0]])) == pytest.approx([3.0, -2.0])
    assert mirror(ball)(np.array([[1.0, -2.0, 8.0]])) == pytest.approx([3.0])


def test_an_ellipsoid_is_stretched_and_rotated():
    part = ellipsoid((0.0, 0.0, 0.0), (3.0, 2.0, 1.0), pitch=90.0)
    on_it = np.array([[0.0, 0.0, 3.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]])
    assert part(on_it) == pytest.approx(0.0, abs=1e-12)
    part = ellipsoid((0.0, 0.0, 0.0), (3.0, 2.0, 1.0), yaw=90.0)
    on_it = np.array([[0.0, 3.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert part(on_it) == pytest.approx(0.0, abs=1e-12)
    ball = ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    on_it = np.array([[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    assert stretch(ball, (3.0, 2.0, 1.0))(on_it) == pytest.approx(0.0, abs=1e-12)


def test_a_blend_is_the_union_where_the_parts_are_apart():
    one = ellipsoid((-1.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    other = ellipsoid((1.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    both = blend(one, other, 0.4)
    assert both(np.array([[-3.0, 0.0, 0.0], [2.5, 0.0, 0.0]])) == pytest.approx([1.0, 0.5])
    assert both(np.array([[0.0, 0.0, 0.0]])) == pytest.approx([-0.1])
