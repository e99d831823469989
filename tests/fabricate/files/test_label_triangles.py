"""Triangles of labels, by their areas."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.fabricate.files.label_triangles import label_triangles
from dicedesign.fabricate.labels.glyphs import label_contours
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import doubled_area_vectors


def test_labels_have_the_areas_of_their_floors_and_walls(contents, placements) -> None:
    (part,) = contents.parts
    areas = 0.5 * np.linalg.norm(doubled_area_vectors(part.points, part.triangles), axis=1)
    depth, floors, walls = EngravingOptions().depth_mm, 0.0, 0.0
    for placement in placements:
        for contour in label_contours(placement.text):
            edges = np.roll(contour, -1, axis=0) - contour
            walls += depth * placement.height * np.linalg.norm(edges, axis=1).sum()
            doubled = contour[:, 0] @ edges[:, 1] - contour[:, 1] @ edges[:, 0]
            floors += 0.5 * doubled * placement.height**2
    assert areas[part.labels].sum() == pytest.approx(walls + floors, rel=1e-6)
    box = 2.0 * (14.0 * 16.0 + 16.0 * 20.0 + 20.0 * 14.0)
    assert areas[~part.labels].sum() == pytest.approx(box - floors, rel=1e-6)


def test_a_die_without_labels_has_no_triangles_of_labels(box) -> None:
    body = box(3.0, 4.0, 5.0)
    plain = Surface(body.vertices, body.triangles)
    assert not label_triangles(plain, plain, 0.6).any()
