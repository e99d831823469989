"""Closest points, distances, depths, winding numbers and level sets."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere, gear
from common.dented_cube import dented_cube
from scipy.ndimage import gaussian_filter, map_coordinates

from dicedesign.geometry.surfaces.grid_surface import (
    GridValues,
    closest_points,
    depths_inside,
    distances_from_surface,
    winding_numbers,
)
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface, winding_number
from dicedesign.runtime.arrays import Floats


def places_around(surface: Surface, count: int, seed: int) -> Floats:
    spread = np.random.default_rng(seed).normal(size=(count, 3))
    return surface.centroid + 0.4 * surface.diagonal * spread


def test_distances_from_a_box_are_those_of_the_closed_form() -> None:
    cube = dented_cube(0.0)
    places = places_around(cube, 500, 1)
    beyond = np.abs(places) - 1.0
    signed = np.linalg.norm(beyond.clip(0.0), axis=1) + beyond.max(axis=1).clip(max=0.0)
    np.testing.assert_allclose(distances_from_surface(cube, places), np.abs(signed), atol=1e-15)
    np.testing.assert_allclose(depths_inside(cube, places), -signed, atol=1e-15)


@pytest.mark.parametrize("surface", [bumpy_sphere(2), bent_capsule()])
def test_closest_points_against_all_triangles_by_trimesh(surface: Surface) -> None:
    places = np.concatenate([places_around(surface, 60, 6), surface.points[:20]])
    corners, count = surface.points[surface.triangles], len(surface.triangles)
    triangles, feet = closest_points(surface, places)
    for place, foot, chosen in zip(places, feet, triangles, strict=True):
        every = trimesh.triangles.closest_point(corners, np.repeat(place[None], count, axis=0))
        least = np.linalg.norm(every - place, axis=1).min()
        assert np.linalg.norm(foot - place) == pytest.approx(least, abs=1e-12)
        assert np.linalg.norm(every[chosen] - foot) < 1e-12
    assert len(closest_points(surface, places[:0])[0]) == 0


def test_winding_numbers_are_sums_of_solid_angles() -> None:
    surface = gear()
    pierced = Surface(surface.points, surface.triangles[5:])
    places = places_around(surface, 200, 3)
    corners = pierced.points[pierced.triangles]
    expected = [winding_number(place, corners) for place in places]
    np.testing.assert_allclose(winding_numbers(pierced, places), expected, atol=0.02)


def test_level_sets_of_depths_in_a_ball_are_balls() -> None:
    low, high = np.full(3, -1.2), np.full(3, 1.2)
    grid = GridValues(lambda places: 1.0 - np.linalg.norm(places, axis=1), low, high, 0.1)
    assert (np.abs(grid.nodes) < 1.3).all()
    assert grid.cell**3 * len(grid.nodes) == pytest.approx(2.4**3, rel=0.2)
    for depth in (0.0, 0.33):
        surface = grid.above(depth)
        np.testing.assert_allclose(np.linalg.norm(surface.points, axis=1), 1.0 - depth, atol=3e-3)
        assert surface.volume == pytest.approx(4.0 / 3.0 * np.pi * (1.0 - depth) ** 3, rel=0.02)
    assert len(grid.above(1.1).triangles) == 0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("blur", [0.0, 0.7, 1.5])
def test_the_level_set_of_noise_is_a_manifold_that_does_not_meet_itself(
    seed: int, blur: float
) -> None:
    noise = np.random.default_rng(seed).normal(size=(12, 12, 12))
    values = gaussian_filter(noise, blur) if blur else noise
    values = values - np.quantile(values, 0.7)

    def interpolate(places: Floats) -> Floats:
        return np.asarray(map_coordinates(values, places.T, order=1))

    grid = GridValues(interpolate, np.zeros(3), np.full(3, 11.0), 1.0)
    surface = grid.above(0.0)
    mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert len(intersecting_triangles(surface.points, surface.triangles)) == 0
