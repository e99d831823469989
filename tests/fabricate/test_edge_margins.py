"""Margins at sharp edges, against the angle of wedges and against solids that are cut."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dicedesign.fabricate.engraving import engrave
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import edge_margins, place_labels
from dicedesign.geometry.hulls.hull import convex_hull


def wedge(degrees: float) -> np.ndarray:
    """A prism over an isosceles triangle with an angle at its apex, in mm."""
    half = math.radians(degrees) / 2.0
    triangle = 20.0 * np.array([(0.0, 0.0), (math.cos(half), math.sin(half))])
    triangle = np.vstack([triangle, triangle[1] * (1.0, -1.0)])
    return np.array([(x, y, z) for x, y in triangle for z in (-15.0, 15.0)])


@pytest.mark.parametrize("degrees", [30.0, 60.0, 90.0, 120.0, 150.0])
def test_a_pocket_as_deep_reaches_the_bisector_of_the_edge_but_for_the_wall(degrees: float) -> None:
    options = EngravingOptions(depth_mm=0.8, margin_mm=0.4)
    hull = convex_hull(wedge(degrees))
    facet = int(np.argmax(hull.normals[:, 1]))
    margins = edge_margins(hull, facet, options)
    polygon = hull.polygon(facet)
    following = np.roll(polygon, -1, axis=0)
    apex = np.flatnonzero((abs(polygon[:, 0]) < 1e-9) & (abs(following[:, 0]) < 1e-9))
    expected = max(0.4, 0.8 / math.tan(math.radians(degrees) / 2.0) + 0.2)
    assert margins[apex] == pytest.approx(expected)
    ends = np.flatnonzero(abs(polygon[:, 2] - following[:, 2]) < 1e-9)
    assert margins[ends] == pytest.approx(1.0)  # the ends are upright


@pytest.mark.parametrize("depth_mm", [0.3, 0.6, 1.2, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_pockets_on_all_facets_of_a_random_die_neither_meet_nor_break_through(
    seed: int, depth_mm: float
) -> None:
    """The engraver checks it by the solid."""
    points = np.random.default_rng(seed).normal(size=(8, 3))
    hull = convex_hull(25.0 * points / np.linalg.norm(points, axis=1, keepdims=True))
    options = EngravingOptions(depth_mm=depth_mm, min_height_mm=0.3, max_height_mm=30.0)
    facets, margins = [], []
    for facet in range(len(hull.normals)):
        margin = edge_margins(hull, facet, options)
        try:
            place_labels(
                ["■"],
                [hull.polygon(facet)],
                [hull.normals[facet]],
                [facet],
                options,
                50.0,
                [margin],
            )
        except ValueError:
            continue
        facets.append(facet)
        margins.append(margin)
    assert facets
    placements = place_labels(
        ["■"] * len(facets),
        [hull.polygon(facet) for facet in facets],
        hull.normals[facets],
        facets,
        options,
        50.0,
        margins,
    )
    assert len(engrave(hull.vertices, hull.triangles, placements, options).points)
