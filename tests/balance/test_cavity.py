"""Cavities that move the center of mass: reach, construction and measurement."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import dented_cube

from dicedesign.balance.cavity import (
    balancing_cavity,
    least_wall,
    measure_cavities,
    reach,
)
from dicedesign.errors import InputError
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface, join_surfaces


def test_the_smallest_cavity_of_a_cube_is_a_slab() -> None:
    center, half = 0.05, 0.7
    cavity = balancing_cavity(dented_cube(0.0), 1.0 - half, np.array([center, 0.0, 0.0]))
    # Moments of the slab from -half to x, and of the cube, about the new center.
    area, moment = 4.0 * half**2, 8.0 * center
    x = center - np.sqrt((half + center) ** 2 - 2.0 * moment / area)
    slab = area * (x + half)
    assert slab <= cavity.volume < 1.03 * slab


def test_a_surface_with_dents_has_walls_of_the_thickness() -> None:
    surface, wall = dented_cube(), 0.2
    center = surface.centroid + np.array([0.03, 0.04, 0.0])
    cavity = balancing_cavity(surface, wall, center)
    whole = join_surfaces(surface, cavity.reverse())
    np.testing.assert_allclose(whole.centroid, center, atol=1e-12)
    assert len(intersecting_triangles(whole.points, whole.triangles)) == 0
    nearest = distances_from_surface(surface, cavity.points).min()
    assert nearest >= wall
    assert distances_from_surface(cavity, surface.points).min() >= wall
    assert least_wall(surface, cavity) <= nearest + 1e-12


def test_a_center_out_of_reach() -> None:
    with pytest.raises(InputError, match="hollow: expected a center of mass that cavities lead to"):
        balancing_cavity(dented_cube(0.0), 0.3, np.array([0.4, 0.0, 0.0]))


def farthest(half: float) -> float:
    """Farthest shift x along an edge of a cube of side 2 with a cavity in an inner cube of side
    2 half. The cavity is all behind the new center of mass, about which the moment of the cube,
    8 x, equals the moment of the cavity."""
    x = 0.0
    for _ in range(100):
        x = 4.0 * half**2 * (half + x) ** 2 / 16.0
    return x


def test_reach_in_a_cube_along_its_edges() -> None:
    wall = 0.3
    expected = farthest(1.0 - wall)
    shifts = reach(dented_cube(0.0), wall)
    for direction in np.concatenate([np.eye(3), -np.eye(3)]):
        most = float((shifts.vertices @ direction).max())
        assert 0.75 * expected < most < 1.03 * expected


def inward(size: float, middle: tuple[float, float, float]) -> Surface:
    cube = dented_cube(0.0)
    return Surface(size * cube.points + np.array(middle), cube.triangles[:, ::-1])


def test_two_cavities_in_a_cube() -> None:
    inner = inward(0.2, (0.5, 0.0, 0.0)), inward(0.1, (-0.5, 0.0, 0.0))
    cavities = measure_cavities(join_surfaces(dented_cube(0.0), *inner))
    assert cavities.number == 2
    assert cavities.wall_mm == pytest.approx(0.3, rel=1e-12)
    assert cavities.volume_mm3 == pytest.approx(0.072, rel=1e-12)
    assert cavities.part == pytest.approx(0.009, rel=1e-12)
    assert cavities.shift_mm == pytest.approx((0.064 - 0.008) * 0.5 / (8.0 - 0.072), rel=1e-12)


def test_a_body_without_any() -> None:
    cube = dented_cube(0.0)
    with pytest.raises(InputError, match="expected one surface with others inside, got 1 orient"):
        measure_cavities(cube)
