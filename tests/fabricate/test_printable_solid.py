"""What manifold3d makes of good, dirty and broken surfaces."""

from __future__ import annotations

import re

import numpy as np
import pytest
from common.bumpy import ball, self_intersecting_sphere

from dicedesign.errors import InputError
from dicedesign.fabricate.surface_assessment import printable_solid
from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.geometry.surfaces.quality import surface_quality
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface


def test_slivers_are_collapsed_and_counted_and_nothing_else() -> None:
    before = ball(4)
    assert printable_solid(before)[2] == ()
    points = before.points.copy()
    a, b = before.triangles[0, :2]
    points[a] = points[b] + 1e-9 * (points[a] - points[b])
    assert len(surface_quality(before.with_points(points)).slivers) == 2
    found, triangles, notes = printable_solid(before.with_points(points))
    after = Surface(found, triangles)
    assert len(surface_quality(after).slivers) == 0
    assert len(triangles) == len(before.triangles) - 2
    assert len(notes) == 1
    assert re.match(
        r"edges and slivers were taken out: 5118 triangles are left of 5120, volume [+-]\d.* %$",
        notes[0],
    )
    assert after.volume == pytest.approx(before.with_points(points).volume, rel=1e-8)


def test_where_the_solid_meets_itself_is_left_and_said() -> None:
    points, triangles, notes = printable_solid(self_intersecting_sphere())
    pairs = intersecting_triangles(points, triangles)
    assert len(pairs) > 0
    assert notes[-1].startswith(f"the solid still meets itself in {len(pairs)} pairs of triangles")


def ring_with_overlap() -> Surface:
    """A sphere bent into a ring about the z axis whose ends overlap."""
    along, across, up = ball(3).points.T
    angle, radius = 1.06 * np.pi * along, 1.0 + 0.3 * across
    height = 0.3 * up + 0.05 * along
    points = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), height))
    return Surface(points, ball(3).triangles[:, ::-1].copy())


def test_parts_that_overlap_are_joined() -> None:
    before = ring_with_overlap()
    assert len(intersecting_triangles(before.points, before.triangles)) > 20
    points, triangles, notes = printable_solid(before)
    after = Surface(points, triangles)
    assert len(intersecting_triangles(points, triangles)) == 0
    assert surface_quality(after).genus == 1
    assert notes[0].startswith("parts that overlap were joined: ")
    assert notes[0].endswith("0 handles before and 1 after")
    # What is lost is what winds twice: counted at random places.
    places = np.random.default_rng(0).uniform(-1, 1, (2000, 3)) * [0.2, 0.25, 0.2] - [1, 0, 0]
    corners = before.points[before.triangles]
    twice = 0
    for place in places:
        a, b, c = (corners - place).transpose(1, 0, 2)
        twice += signed_solid_angle(a, b, c, np).sum() > 6 * np.pi
    lost = twice / len(places) * 0.4 * 0.5 * 0.4
    assert lost > 0.001
    assert before.volume - after.volume == pytest.approx(lost, rel=0.25)


def test_what_is_no_solid_is_refused() -> None:
    before = ball(4)
    with pytest.raises(InputError, match="NotManifold for 5119 triangles; repair"):
        printable_solid(Surface(before.points, before.triangles[1:]))
    with pytest.raises(InputError, match="reverse their corners"):
        printable_solid(Surface(before.points, before.triangles[:, ::-1]))


def test_a_solid_that_is_gone_when_it_is_cleaned_is_refused() -> None:
    flat = ball(4).with_points(ball(4).points * [1, 1, 1e-9])
    with pytest.raises(InputError, match="printable solid: expected one piece of positive volume"):
        printable_solid(flat)
