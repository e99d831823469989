"""Depths inside surfaces, against closed forms and the winding number."""

from __future__ import annotations

import numpy as np
from common.dented_cube import dented_cube

from dicedesign.geometry.surfaces.distances import depth_grid
from dicedesign.geometry.triangles import winding_number
from tests.reference.gear import gear


def test_depths_of_a_cube_are_those_of_its_nearest_side() -> None:
    grid = depth_grid(dented_cube(0.0), 9)
    depths = 1.0 - np.abs(grid.places(np.indices(grid.depths.shape).reshape(3, -1).T)).max(axis=1)
    inside = grid.depths.ravel() > 0.0
    np.testing.assert_array_equal(inside, depths > 0.0)
    np.testing.assert_allclose(grid.depths.ravel()[inside], depths[inside], rtol=1e-12)


def test_nodes_next_to_one_inside_are_as_far_outside_and_others_endlessly() -> None:
    grid = depth_grid(dented_cube(0.0), 9)
    near = np.isfinite(grid.depths) & (grid.depths <= 0.0)
    places = grid.places(np.argwhere(near))
    np.testing.assert_allclose(-grid.depths[near], np.abs(places).max(axis=1) - 1.0, rtol=1e-12)
    inside = grid.depths > 0.0
    beside = np.zeros_like(inside)
    for axis in range(3):
        beside |= np.roll(inside, 1, axis) | np.roll(inside, -1, axis)
    np.testing.assert_array_equal(near, beside & ~inside)
    assert (grid.depths[~near & ~inside] == -np.inf).all()


def test_inside_is_where_the_surface_winds_around_a_node() -> None:
    surface = gear()
    grid = depth_grid(surface, 20)
    nodes = np.indices(grid.depths.shape).reshape(3, -1).T
    corners = surface.points[surface.triangles]
    for node in nodes[np.random.default_rng(3).choice(len(nodes), 300, replace=False)]:
        wound = winding_number(grid.places(node), corners) > 0.5
        assert (grid.depths[tuple(node)] > 0.0) == wound
