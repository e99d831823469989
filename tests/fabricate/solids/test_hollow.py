"""Cavities of a die, made and measured."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import dented_cube

from dicedesign.errors import InputError
from dicedesign.fabricate.solids.hollow import measured_cavities, with_cavity
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.surface import Surface, joined
from dicedesign.rest.poses import rest_poses


def inward(size: float, middle: tuple[float, float, float]) -> Surface:
    cube = dented_cube(0.0)
    return Surface(size * cube.points + np.array(middle), cube.triangles[:, ::-1])


def test_two_cavities_in_a_cube() -> None:
    whole = joined(dented_cube(0.0), inward(0.2, (0.5, 0.0, 0.0)))
    whole = joined(whole, inward(0.1, (-0.5, 0.0, 0.0)))
    found = measured_cavities(make_body(whole.points, whole.triangles))
    assert found.number == 2
    assert found.wall_mm == pytest.approx(0.3, rel=1e-12)
    assert found.volume_mm3 == pytest.approx(0.072, rel=1e-12)
    assert found.part == pytest.approx(0.009, rel=1e-12)
    assert found.shift_mm == pytest.approx((0.064 - 0.008) * 0.5 / (8.0 - 0.072), rel=1e-12)


def test_a_body_without_any() -> None:
    cube = dented_cube(0.0)
    with pytest.raises(InputError, match="expected one surface with cavities inside, got 1 orient"):
        measured_cavities(make_body(cube.points, cube.triangles))


def test_a_solid_with_one_rests_as_its_center_of_mass_says() -> None:
    center = np.array([0.01, 0.0, -0.03])
    whole = with_cavity(dented_cube(), 0.3, center)
    poses = rest_poses(make_body(whole.points, whole.triangles))
    np.testing.assert_allclose(poses.center_of_mass, center, atol=1e-12)
    assert poses.center_of_mass_source == "uniform solid"
    given = rest_poses(make_body(dented_cube().points), center)
    np.testing.assert_allclose(poses.probabilities, given.probabilities, atol=1e-9)
