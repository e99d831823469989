"""Large meshes are thinned out before anything slow, and meshes are repaired only where asked."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import bumpy_sphere, pushed_through

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.repair.repair import input_surface
from dicedesign.geometry.surfaces.surface import Surface


def large() -> Surface:
    """10,242 points."""
    return bumpy_sphere(5)


def body_of(surface: Surface, first: int = 0) -> Body:
    return make_body(surface.points, surface.triangles[first:], name="thing")


def test_a_small_surface_is_taken_as_it_is() -> None:
    original = bumpy_sphere(2)
    surface, notes, made = input_surface(body_of(original), 1000)
    np.testing.assert_array_equal(surface.points, original.points)
    assert (notes, made) == ((), None)
    assert input_surface(body_of(original), 1000, repair=True)[1:] == (
        ("the mesh needed no repair",),
        None,
    )


@pytest.mark.parametrize("points", [300, 4000])
def test_a_large_one_has_so_many_points(points: int) -> None:
    original = large()
    surface, notes, _ = input_surface(body_of(original), points)
    assert 0.8 * points < len(surface.points) <= points
    assert surface.volume == pytest.approx(original.volume, rel=0.02)
    assert trimesh.Trimesh(surface.points, surface.triangles).is_volume
    assert f"{len(original.points)} to" in notes[0]


def test_what_is_wrong_with_a_large_one_is_told_of_the_mesh_as_it_came() -> None:
    with pytest.raises(InputError, match="3 edges with one triangle"):
        input_surface(body_of(large(), 1), 300)


def test_a_large_one_that_meets_itself_is_refused() -> None:
    with pytest.raises(InputError, match="does not meet itself"):
        input_surface(body_of(pushed_through(5)), 1000)


def test_a_large_one_is_repaired_and_thinned_out() -> None:
    original = large()
    surface, _, made = input_surface(body_of(original, 9), 2000, repair=True)
    assert made is not None
    assert len(surface.points) <= 2000 < len(made.surface.points)
    assert surface.volume == pytest.approx(original.volume, rel=0.01)
    with pytest.raises(InputError):
        input_surface(body_of(original, 9), 2000)
