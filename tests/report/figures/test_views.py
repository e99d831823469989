"""The die from several sides, and its labels."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.fabricate.labels.layout import place_labels
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.fabricate.solids.engraving import engrave
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.report.figures.labels import labels_figure
from dicedesign.report.figures.views import views_figure

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def engraved_cube():
    hull = convex_hull(10.0 * CUBE)
    facets = range(6)
    polygons = [hull.polygon(facet) for facet in facets]
    options = EngravingOptions()
    texts = ["1", "2", "3", "4", "5", "7"]
    labels = place_labels(texts, polygons, hull.normals, facets, options, hull.diameter)
    return engrave(hull.vertices, hull.triangles, labels, options), hull, labels


def test_view_figures():
    die, hull, labels = engraved_cube()
    ups = np.array([label.frame[:3, 1] for label in labels])
    figure = views_figure(die.points, die.triangles)
    assert len(figure.pictures) == 8
    assert "from -z" in figure.texts
    facets = labels_figure(
        die.points, die.triangles, hull.normals, ups, [label.text for label in labels]
    )
    assert facets.texts == [label.text for label in labels]
    again = labels_figure(die.points, die.triangles, hull.normals, ups, list("123457"))
    assert facets.png() == again.png()


def test_facet_views_frame_their_facet():
    hull = convex_hull(CUBE + np.array([50.0, 0.0, 0.0]))
    ups = np.roll(np.abs(hull.normals), 1, axis=1)
    figure = labels_figure(hull.vertices, hull.triangles, hull.normals, ups, ["x"] * 6)
    for picture in figure.pictures:
        rows, columns = np.nonzero((picture < 255).any(axis=2))
        size = len(picture)
        for found in (rows, columns):
            assert found.min() + found.max() == size - 1
            assert np.ptp(found) + 1 == pytest.approx(size / 1.15, abs=2)


def test_facet_views_need_matching_arguments():
    with pytest.raises(InputError, match="got 1 normals, 1 up directions and 2 titles"):
        labels_figure(CUBE, np.array([[0, 1, 2]]), CUBE[:1], CUBE[:1], ["a", "b"])
