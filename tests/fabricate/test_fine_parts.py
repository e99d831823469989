"""Parts that are too thin to print, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.made_up_die import box
from manifold3d import CrossSection, JoinType

from dicedesign.errors import InputError
from dicedesign.fabricate.label_art import text_section
from dicedesign.fabricate.printability import narrowest_stroke, thin_parts
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface


def ring(radius: float, corners: int) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(corners) / corners
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def widths(section: CrossSection) -> tuple[float | None, float | None]:
    """Narrowest stroke and narrowest gap between strokes."""
    return narrowest_stroke(section), narrowest_stroke(section, 1.0)


def test_bars_are_as_wide_as_their_shorter_sides_and_a_triangle_has_no_strokes() -> None:
    bars = CrossSection.square((0.5, 2.0))
    assert widths(bars) == (0.5, None)
    bars += CrossSection.square((0.375, 2.0)).translate((0.75, 0.0))
    assert widths(bars) == pytest.approx((0.375, 0.25), rel=1e-12)
    assert widths(CrossSection([[(0.0, 0.0), (1.0, 0.0), (0.5, 0.9)]]))[0] is None
    assert narrowest_stroke(CrossSection()) is None


def test_a_ring_is_as_wide_as_its_radii_differ() -> None:
    """The width between two regular polygons is the difference of the radii of their inscribed
    circles, in the single precision of sections."""
    inscribed = np.cos(np.pi / 40)
    expected = (0.6 * inscribed, 2.8 * inscribed)
    section = CrossSection([ring(2.0, 40), ring(1.4, 40)[::-1]])
    assert widths(section) == pytest.approx(expected, rel=2e-7)


def test_morphological_opening_removes_the_thinnest_stroke() -> None:
    """A square-cornered disc thinner than the thinnest stroke fits everywhere in the label, a
    thicker one does not."""
    for text in ("3", "10"):
        section = text_section(text)
        stroke = narrowest_stroke(section)
        opened = [
            section.offset(-half, JoinType.Miter).offset(half, JoinType.Miter)
            for half in (0.475 * stroke, 0.55 * stroke)
        ]
        thin, thick = ((section ^ each).area() / section.area() for each in opened)
        assert thin > 0.995 > 0.97 > thick


SPREAD = 0.01
"""Five standard deviations of a share estimated from some ten thousand samples."""


def test_a_tube_is_as_thin_as_its_wall() -> None:
    outer, inner, height = 10.0, 9.4, 20.0
    section = [(inner, 0.0), (outer, 0.0), (outer, height), (inner, height), (inner, 0.0)]
    mesh = trimesh.creation.revolve(np.array(section), sections=64)
    tube = Surface(np.array(mesh.vertices), np.array(mesh.faces))
    thin = thin_parts(tube, 0.8)
    assert thin is not None
    assert thin.least_mm == pytest.approx(outer - inner, rel=3e-3)
    sides = 2.0 * np.pi * (outer + inner) * height
    rims = 2.0 * np.pi * (outer**2 - inner**2)
    assert thin.share == pytest.approx(sides / (sides + rims), abs=SPREAD)
    assert np.hypot(*thin.place[:2]) == pytest.approx((outer + inner) / 2.0, rel=2e-2)
    assert thin_parts(tube, 0.55) is None


@pytest.mark.parametrize(("degrees", "is_thin"), [(60.0, False), (25.0, True)])
def test_only_sharp_edges_are_thin_walls(degrees: float, is_thin: bool) -> None:
    """A prism whose section is a triangle with an angle in degrees."""
    rise = 20.0 * np.tan(np.radians(degrees / 2.0))
    section = np.array([(0.0, 0.0), (20.0, rise), (20.0, -rise)])
    points = np.array([(x, y, z) for x, y in section for z in (0.0, 30.0)])
    thin = thin_parts(convex_hull(points).surface, 0.8)
    assert (thin is not None) == is_thin
    if thin is not None:
        # A ray at a distance s along the side is s tan(angle) long.
        assert thin.place[0] < 0.8 / np.tan(np.radians(degrees))
        reach = 0.8 / np.tan(np.radians(degrees)) * 30.0
        side = np.hypot(20.0, rise) * 30.0
        area = 2.0 * side + 2.0 * rise * 30.0 + 2.0 * 20.0 * rise
        assert thin.share == pytest.approx(2.0 * reach / area, rel=0.1)


def test_thick_bodies_have_no_thin_parts_and_sheets_are_refused() -> None:
    cube = convex_hull(box(20.0, 20.0, 20.0)).surface
    assert thin_parts(cube, 0.8) is None
    with pytest.raises(InputError, match="solid"):
        thin_parts(Surface(cube.points, cube.triangles[:-1]), 0.8)
