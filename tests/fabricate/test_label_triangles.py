"""Triangles of labels, by their areas."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from dicedesign.fabricate.engraving import engrave
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions
from dicedesign.fabricate.label_triangles import labels_below_hull, labels_off_surface
from dicedesign.fabricate.rounded_edges import rounded
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.manifold import mesh_of, solid
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import doubled_area_vectors

DEPTH = EngravingOptions().depth_mm


def area(surface: Surface, which: np.ndarray) -> float:
    doubled = doubled_area_vectors(surface.points, surface.triangles[which])
    return 0.5 * float(np.linalg.norm(doubled, axis=1).sum())


def floors_and_walls(placements) -> tuple[float, float]:
    """Areas by the outlines of the labels."""
    floors = walls = 0.0
    for placement in placements:
        for contour in placement.section().to_polygons():
            edges = np.roll(contour, -1, axis=0) - contour
            walls += DEPTH * np.linalg.norm(edges, axis=1).sum()
            doubled = contour[:, 0] @ edges[:, 1] - contour[:, 1] @ edges[:, 0]
            floors += 0.5 * doubled
    return floors, walls


@pytest.fixture
def marked(contents) -> Surface:
    (part,) = contents.parts
    return Surface(part.points, part.triangles)


def test_labels_have_the_areas_of_their_floors_and_walls(marked, placements) -> None:
    floors, walls = floors_and_walls(placements)
    labels = labels_below_hull(marked, DEPTH)
    assert area(marked, labels) == pytest.approx(floors + walls, rel=1e-6)
    box = 2.0 * (14.0 * 16.0 + 16.0 * 20.0 + 20.0 * 14.0)
    assert area(marked, ~labels) == pytest.approx(box - floors, rel=1e-6)


def test_a_hollow_inside_is_no_label(marked, placements) -> None:
    hollow = Manifold.sphere(3.0, 24)
    with_hollow = Surface(*mesh_of(solid(marked.points, marked.triangles) - hollow))
    labels = labels_below_hull(with_hollow, DEPTH)
    assert area(with_hollow, labels) == pytest.approx(sum(floors_and_walls(placements)), rel=1e-6)


def test_rounded_edges_are_no_labels(box) -> None:
    body = box(14.0, 16.0, 20.0)
    hull = rounded(convex_hull(body.vertices), np.zeros(3), EdgeOptions(radius_mm=1.0))
    assert not labels_below_hull(Surface(hull.vertices, hull.triangles), DEPTH).any()


def test_labels_of_a_surface_that_was_stretched_and_moved(box, marked, placements) -> None:
    """As many triangles as before that, of a body that is plain but for its labels."""
    body = box(14.0, 16.0, 20.0)
    ball = Manifold.sphere(30.0, 60).translate((0.0, -34.0, 0.0))
    dented = solid(body.vertices, body.triangles) - ball
    plain = Surface(*mesh_of(dented))
    engraved = engrave(plain.points, plain.triangles, placements, EngravingOptions())
    expected = labels_off_surface(engraved, plain, DEPTH)
    assert area(engraved, expected) == pytest.approx(sum(floors_and_walls(placements)), rel=1e-6)
    matrix = np.eye(3) + 0.004 * np.random.default_rng(0).uniform(-1.0, 1.0, (3, 3))
    moved = engraved.moved(engraved.points @ matrix + [0.02, -0.03, 0.05])
    np.testing.assert_array_equal(labels_off_surface(moved, plain, DEPTH), expected)
