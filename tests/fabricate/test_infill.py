"""Infill against closed forms, symmetry and random points."""

from __future__ import annotations

import numpy as np
import pytest
from common.made_up_die import SIDES, box, run_to_check
from common.random_points import depths, in_pocket_walls, points_inside

from dicedesign.fabricate.engraving import cut_sections, engrave
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.infill import (
    infill_probabilities,
    inside_walls,
    pocket_walls,
    weigh_print,
)
from dicedesign.fabricate.label_layout import edge_margins, place_labels
from dicedesign.fabricate.label_reading import die_readings
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import solid_properties

PYRAMID = np.array([[12.0, 0, 0], [0, 12, 0], [-12, 0, 0], [0, -12, 0], [3.0, 2.0, 70.0]])


def test_infill_of_a_box() -> None:
    hull = convex_hull(box(20.0, 24.0, 30.0) + np.array([1.0, 2.0, 3.0]))
    inside = inside_walls(hull, 1.5)
    assert inside[0] == pytest.approx(17.0 * 21.0 * 27.0)
    mass, center = weigh_print(20.0 * 24.0 * 30.0, hull.centroid, inside, 0.2)
    assert mass == pytest.approx(1.0 - 0.8 * 17.0 * 21.0 * 27.0 / (20.0 * 24.0 * 30.0))
    np.testing.assert_allclose(center, [1.0, 2.0, 3.0], atol=1e-12)
    # Walls that meet leave no inside.
    flat = convex_hull(box(20.0, 20.0, 2.0))
    assert inside_walls(flat, 1.0)[0] == 0.0 < inside_walls(flat, 0.9)[0]


def test_infill_of_a_pyramid_against_random_points() -> None:
    hull, infill, walls = convex_hull(PYRAMID), 0.2, 3.0
    volume, centroid = solid_properties(hull.vertices, hull.triangles)
    mass, center = weigh_print(volume, centroid, inside_walls(hull, walls), infill)
    points = points_inside(hull, 400_000)
    depth = depths(hull, points).min(axis=1)
    density = np.where(depth > walls, infill, 1.0)
    assert mass == pytest.approx(density.mean(), abs=4.0 * density.std() / np.sqrt(len(points)))
    expected = (density[:, None] * points).sum(axis=0) / density.sum()
    error = np.sqrt((np.square(density[:, None] * (points - expected))).mean(axis=0))
    error = error / density.mean() / np.sqrt(len(points))
    np.testing.assert_array_less(np.abs(center - expected), 4.0 * error)
    # The shift is larger than the noise.
    assert np.linalg.norm(center - hull.centroid) > 5.0 * error.max()


@pytest.mark.parametrize(("text", "style"), [("8", "engraved"), ("5", "raised")])
def test_pockets_have_walls(text: str, style: str) -> None:
    hull = convex_hull(box(14.0, 15.0, 16.0))
    options, walls = EngravingOptions(depth_mm=1.5, max_height_mm=7.0, style=style), 0.7
    facet = int(np.argmax(hull.normals[:, 2]))
    places = die_readings(hull, np.array([facet]), [text], "down")[0].places
    margins = [edge_margins(hull, facet, options)]
    placements = place_labels(places, options, hull.diameter, margins)
    surface = engrave(hull.surface, placements, options)
    sections = cut_sections(hull, placements, options)
    inside = inside_walls(hull, walls, pocket_walls(sections, options.depth_mm, walls))
    plain = inside_walls(hull, walls)
    points = points_inside(hull, 100_000)
    volume = 14.0 * 15.0 * 16.0 / len(points)
    deep = points[depths(hull, points).min(axis=1) > walls]
    lost = deep[in_pocket_walls(surface, hull, deep, options.depth_mm, walls)]
    difference = plain[0] - inside[0]
    assert difference == pytest.approx(volume * len(lost), rel=4.0 / np.sqrt(len(lost)))
    center = (plain[0] * plain[1] - inside[0] * inside[1]) / difference
    error = lost.std(axis=0) / np.sqrt(len(lost))
    np.testing.assert_array_less(np.abs(center - lost.mean(axis=0)), 4.0 * error)
    # The noise is small beside the effect.
    assert 4.0 / np.sqrt(len(lost)) < 0.12


def test_the_least_infill_leaves_some_mass() -> None:
    """Without infill, extremely thin walls leave an uncertain center of mass."""
    verdict = run_to_check(box(4.0, 5.0, 6.0)).plain
    volume, centroid = solid_properties(verdict.body.points, verdict.body.triangles)
    inside = (1.0 - 1e-9) * volume, centroid + 1e-6
    result = infill_probabilities(verdict, SIDES, volume, inside, 0.5, 1e-9)
    assert result.least_infill == pytest.approx(0.05)
