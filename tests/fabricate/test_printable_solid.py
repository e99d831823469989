"""Printable solids of good, dirty and broken surfaces."""

from __future__ import annotations

import re

import pytest
from common.bumpy import ball, self_intersecting_sphere

from dicedesign.errors import InputError
from dicedesign.fabricate.surface_assessment import printable_solid
from dicedesign.geometry.surfaces.quality import surface_quality
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles


def test_slivers_are_collapsed_and_counted() -> None:
    before = ball(4)
    assert printable_solid(before)[1] == ()
    points = before.points.copy()
    a, b = before.triangles[0, :2]
    points[a] = points[b] + 1e-9 * (points[a] - points[b])
    assert len(surface_quality(before.with_points(points)).slivers) == 2
    after, (note,) = printable_solid(before.with_points(points))
    assert len(surface_quality(after).slivers) == 0
    assert len(after.triangles) == len(before.triangles) - 2
    assert re.match(
        r"edges and slivers were taken out: 5118 triangles are left of 5120, volume [+-]\d.* %$",
        note,
    )
    assert after.volume == pytest.approx(before.with_points(points).volume, rel=1e-8)


def test_self_intersections_are_reported() -> None:
    surface, notes = printable_solid(self_intersecting_sphere())
    pairs = intersecting_triangles(surface.points, surface.triangles)
    assert len(pairs) > 0
    assert notes[-1].startswith(
        f"the solid still intersects itself in {len(pairs)} pairs of triangles"
    )


def test_a_surface_whose_cleaned_solid_is_empty_is_refused() -> None:
    flat = ball(4).with_points(ball(4).points * [1, 1, 1e-9])
    with pytest.raises(InputError, match="printable solid: expected one piece of positive volume"):
        printable_solid(flat)
