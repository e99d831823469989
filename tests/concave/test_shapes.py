"""Built-in surfaces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from dicedesign.concave.shapes import SHAPES, ellipsoid, level_set, shape
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles


@pytest.mark.parametrize("name", SHAPES)
def test_surfaces_are_closed_outward_and_of_known_genus(name: str) -> None:
    surface = shape(name)
    mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
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


def test_a_level_set_matches_its_surface_and_volume() -> None:
    low, high = np.full(3, -1.4), np.full(3, 1.4)
    surface = level_set(ellipsoid((0.1, 0.0, -0.1), (1.2, 0.9, 0.7)), low, high, 0.1)
    offsets = (surface.points - (0.1, 0.0, -0.1)) / (1.2, 0.9, 0.7)
    assert np.linalg.norm(offsets, axis=1) == pytest.approx(1.0, abs=5e-3)
    assert surface.volume == pytest.approx(4.0 / 3.0 * np.pi * 1.2 * 0.9 * 0.7, rel=0.01)
