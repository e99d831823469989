"""The die from several sides."""

from __future__ import annotations

import numpy as np

from dicedesign.fabricate.engraving import engrave
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import place_labels
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.report.figures.views import views_figure

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def engraved_cube():
    hull = convex_hull(10.0 * CUBE)
    facets = range(6)
    polygons = [hull.polygon(facet) for facet in facets]
    options = EngravingOptions()
    texts = ["1", "2", "3", "4", "5", "7"]
    labels = place_labels(texts, polygons, hull.normals, facets, options, hull.diameter)
    return engrave(hull.vertices, hull.triangles, labels, options)


def test_view_figures():
    die = engraved_cube()
    figure = views_figure(die.points, die.triangles)
    assert len(figure.pictures) == 8
    assert "from -z" in figure.texts
