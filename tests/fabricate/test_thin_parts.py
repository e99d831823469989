"""Parts that are too thin to print, against closed forms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import trimesh
from common.made_up_die import box

from dicedesign.errors import InputError
from dicedesign.fabricate.fine_parts import thin_parts
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

SPREAD = 0.01
"""Of shares by some ten thousands of samples, five standard deviations."""


def hull_of(points: Floats) -> Surface:
    hull = convex_hull(points)
    return Surface(hull.vertices, hull.triangles)


def revolved(profile: Sequence[tuple[float, float]]) -> Surface:
    """Of a section given by radii and heights from bottom to top, or around it and back."""
    mesh = trimesh.creation.revolve(np.array(profile), sections=128)
    return Surface(np.array(mesh.vertices), np.array(mesh.faces))


@pytest.mark.parametrize("scale", [1.0, 25.0])
def test_a_slab_is_as_thin_as_it_is(scale: float) -> None:
    slab = hull_of(scale * box(20.0, 16.0, 0.5))
    found = thin_parts(slab, 0.8 * scale)
    assert found is not None
    assert found.wall_mm == 0.8 * scale
    assert found.least_mm == pytest.approx(0.5 * scale, rel=1e-9)
    rim = 2.0 * (20.0 + 16.0) * 0.5
    assert found.share == pytest.approx(640.0 / (640.0 + rim), abs=SPREAD)
    assert found.place[2] == pytest.approx(0.0, abs=1e-9 * scale)
    assert thin_parts(slab, 0.45 * scale) is None


def test_a_tube_is_as_thin_as_its_wall() -> None:
    outer, inner, height = 10.0, 9.4, 20.0
    section = [(inner, 0.0), (outer, 0.0), (outer, height), (inner, height), (inner, 0.0)]
    tube = revolved(section)
    assert tube.volume == pytest.approx(np.pi * (outer**2 - inner**2) * height, rel=2e-3)
    found = thin_parts(tube, 0.8)
    assert found is not None
    assert found.least_mm == pytest.approx(outer - inner, rel=2e-3)
    sides = 2.0 * np.pi * (outer + inner) * height
    rims = 2.0 * np.pi * (outer**2 - inner**2)
    assert found.share == pytest.approx(sides / (sides + rims), abs=SPREAD)
    assert np.hypot(*found.place[:2]) == pytest.approx((outer + inner) / 2.0, rel=2e-2)
    assert thin_parts(tube, 0.55) is None


def test_a_thin_bridge_between_two_balls_is_found() -> None:
    """Balls of radius 5 about heights of -8 and 8, joined by a bar of radius 0.2."""
    thin, radius, middle = 0.2, 5.0, 8.0
    begin = np.arcsin(thin / radius)
    arc = [(radius * np.sin(a), middle - radius * np.cos(a)) for a in np.linspace(begin, np.pi, 80)]
    arc[-1] = (0.0, middle + radius)
    found = thin_parts(revolved([(r, -z) for r, z in reversed(arc)] + arc), 0.8)
    assert found is not None
    assert found.least_mm == pytest.approx(2.0 * thin, rel=5e-3)
    length = 2.0 * (middle - radius * np.cos(begin))
    bar, balls = 2.0 * np.pi * thin * length, 2.0 * 4.0 * np.pi * radius**2
    assert found.share == pytest.approx(bar / (bar + balls), rel=0.2)
    assert abs(found.place[2]) < length / 2.0
    assert np.hypot(*found.place[:2]) < 0.05 * thin


@pytest.mark.parametrize(("degrees", "is_thin"), [(60.0, False), (90.0, False), (25.0, True)])
def test_an_edge_is_no_thin_wall_unless_it_is_a_knife(degrees: float, is_thin: bool) -> None:
    """A prism whose section is a triangle with one angle of so many degrees."""
    rise = 20.0 * np.tan(np.radians(degrees / 2.0))
    section = np.array([(0.0, 0.0), (20.0, rise), (20.0, -rise)])
    points = np.array([(x, y, z) for x, y in section for z in (0.0, 30.0)])
    found = thin_parts(hull_of(points), 0.8)
    assert (found is not None) == is_thin
    if found is not None:
        # A ray at a distance s along the side is s tan(angle) long.
        assert found.place[0] < 0.8 / np.tan(np.radians(degrees))
        reach = 0.8 / np.tan(np.radians(degrees)) * 30.0
        side = np.hypot(20.0, rise) * 30.0
        area = 2.0 * side + 2.0 * rise * 30.0 + 2.0 * 20.0 * rise
        assert found.share == pytest.approx(2.0 * reach / area, rel=0.1)


def test_thick_bodies_have_no_thin_parts_and_sheets_are_refused() -> None:
    assert thin_parts(hull_of(box(20.0, 20.0, 20.0)), 0.8) is None
    cube = hull_of(box(20.0, 20.0, 20.0))
    with pytest.raises(InputError, match="solid"):
        thin_parts(Surface(cube.points, cube.triangles[:-1]), 0.8)
