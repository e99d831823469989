"""Distances from surfaces, and depths inside them on a grid."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere, gear
from common.dented_cube import dented_cube

from dicedesign.geometry.surfaces.grid_surface import (
    closest_points,
    depth_grid,
    distances_from_surface,
)
from dicedesign.geometry.triangles import Surface, winding_number


@pytest.mark.parametrize("surface", [bumpy_sphere(), bent_capsule()])
def test_closest_points_against_all_triangles_by_trimesh(surface: Surface) -> None:
    rng = np.random.default_rng(6)
    spread = 0.4 * surface.diagonal * rng.normal(size=(200, 3))
    points = np.concatenate([surface.centroid + spread, surface.points[:50]])
    corners, count = surface.points[surface.triangles], len(surface.triangles)
    distances = distances_from_surface(surface, points)
    for point, distance in zip(points, distances, strict=True):
        feet = trimesh.triangles.closest_point(corners, np.repeat(point[None], count, axis=0))
        assert distance == pytest.approx(np.linalg.norm(feet - point, axis=1).min(), abs=1e-12)
    triangles, weights = closest_points(surface, points)
    assert (weights >= 0.0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    feet = (weights[:, :, None] * corners[triangles]).sum(1)
    np.testing.assert_allclose(np.linalg.norm(feet - points, axis=1), distances, atol=1e-12)


def test_depths_of_a_cube_are_those_of_its_nearest_side() -> None:
    grid = depth_grid(dented_cube(0.0), 9)
    depths = 1.0 - np.abs(grid.places(np.indices(grid.depths.shape).reshape(3, -1).T)).max(axis=1)
    inside = grid.depths.ravel() > 0.0
    np.testing.assert_array_equal(inside, depths > 0.0)
    np.testing.assert_allclose(grid.depths.ravel()[inside], depths[inside], rtol=1e-12)


def test_inside_is_where_the_surface_winds_around_a_node() -> None:
    surface = gear()
    grid = depth_grid(surface, 20)
    nodes = np.indices(grid.depths.shape).reshape(3, -1).T
    corners = surface.points[surface.triangles]
    for node in nodes[np.random.default_rng(3).choice(len(nodes), 300, replace=False)]:
        wound = winding_number(grid.places(node), corners) > 0.5
        assert (grid.depths[tuple(node)] > 0.0) == wound
