"""Cavities that bring the center of mass to a place."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import dented_cube

from dicedesign.concave.hollow.cavity import balancing_cavity, least_wall
from dicedesign.errors import InputError
from dicedesign.geometry.surfaces.distances import distances_from_surface
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface, joined
from tests.reference.gear import gear


def hollow(surface: Surface, cavity: Surface) -> Surface:
    return joined(surface, Surface(cavity.points, cavity.triangles[:, ::-1]))


@pytest.mark.parametrize("center", [(0.05, 0.0, 0.0), (0.02, -0.03, 0.03), (-1e-3, 2e-3, 1e-3)])
def test_a_cube_has_its_center_of_mass_there(center: tuple[float, float, float]) -> None:
    cube, wall = dented_cube(0.0), 0.3
    cavity = balancing_cavity(cube, wall, np.array(center))
    np.testing.assert_allclose(hollow(cube, cavity.surface).centroid, center, atol=1e-12)
    # The depth within a cube is concave: least at a corner.
    depth = 1.0 - np.abs(cavity.surface.points).max()
    assert depth >= wall
    assert cavity.wall <= depth + 1e-12


def test_none_takes_less_than_a_slab_at_the_far_side() -> None:
    center, half = 0.05, 0.7
    cavity = balancing_cavity(dented_cube(0.0), 1.0 - half, np.array([center, 0.0, 0.0]))
    # Moment of the slab from -half to x about the place, and that of the cube.
    area, moment = 4.0 * half**2, 8.0 * center
    x = center - np.sqrt((half + center) ** 2 - 2.0 * moment / area)
    slab = area * (x + half)
    assert slab <= cavity.surface.volume < 1.03 * slab


def test_a_surface_with_dents_has_walls_of_the_thickness() -> None:
    surface = gear()
    wall = 0.02 * surface.diagonal
    center = surface.centroid + 0.02 * surface.diagonal * np.array([0.6, 0.8, 0.0])
    cavity = balancing_cavity(surface, wall, center)
    whole = hollow(surface, cavity.surface)
    np.testing.assert_allclose(whole.centroid, center, atol=1e-12 * surface.diagonal)
    assert len(intersecting_triangles(whole.points, whole.triangles)) == 0
    nearest = distances_from_surface(surface, cavity.surface.points).min()
    assert nearest >= wall
    assert distances_from_surface(cavity.surface, surface.points).min() >= wall
    assert least_wall(surface, cavity.surface) <= nearest + 1e-12


def test_least_wall_of_a_cube_within_a_cube() -> None:
    cube = dented_cube(0.0)
    inner = cube.moved(0.25 * cube.points + np.array([0.1, -0.2, 0.3]))
    assert least_wall(cube, inner) == pytest.approx(0.45, rel=1e-12)


def test_a_place_that_no_cavity_leads_to() -> None:
    with pytest.raises(InputError, match="hollow: expected a center of mass that cavities lead to"):
        balancing_cavity(dented_cube(0.0), 0.3, np.array([0.4, 0.0, 0.0]))


def test_walls_that_leave_no_room() -> None:
    with pytest.raises(InputError, match="hollow: expected room for a cavity in walls of"):
        balancing_cavity(dented_cube(0.0), 1.2, np.array([0.01, 0.0, 0.0]))
