"""A box with labels cut in, and one with an inlay, as files hold them."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.fabricate.files.file_format import BODY_COLOR, LABEL_COLOR, Contents, Part
from dicedesign.fabricate.files.label_triangles import labels_below_hull
from dicedesign.fabricate.labels.layout import place_labels
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.fabricate.solids.engraving import engrave

FACTS = {
    "Application": "dicedesign 7",
    "Description": "Less than <2> outcomes & 'more' or \"more\".",
    "Target": '{"1": 0.5, "2": 0.5}',
    "Recipe": "name: box\ntarget:\n  fair: 2\n# \N{DEGREE SIGN}\n",
}


@pytest.fixture
def placements(box):
    body = box(14.0, 16.0, 20.0)
    return place_labels(
        ["1", "8", "6."],
        body.polygons[:3],
        body.normals[:3],
        range(3),
        EngravingOptions(),
        body.size_mm,
    )


@pytest.fixture
def contents(box, placements) -> Contents:
    """A box of 14, 16 and 20 mm with three labels."""
    body, options = box(14.0, 16.0, 20.0), EngravingOptions()
    marked = engrave(body.vertices, body.triangles, placements, options)
    labels = labels_below_hull(marked, options.depth_mm)
    part = Part("die", BODY_COLOR, marked.points, marked.triangles, labels)
    return Contents("box & co", [part], FACTS)


@pytest.fixture
def inlaid(box) -> Contents:
    """A box of 10 mm with a pit of 4 mm in its top, and a block that fills the pit."""
    pit = box(4.0, 4.0, 4.0)
    outer = box(10.0, 10.0, 10.0)
    floor = np.array([0.0, 0.0, 3.0])
    # The pit is open: its top lies in the box's, of which a frame of eight triangles is left.
    points = np.concatenate([outer.vertices, pit.vertices + floor])
    top, sides = outer.facets[0], outer.facets[1:]
    rim = pit.facets[0] + 8
    frame = []
    for k in range(4):
        a, b, c, d = top[k], top[(k + 1) % 4], rim[(k + 1) % 4], rim[k]
        frame += [(a, b, c), (a, c, d)]
    outside = np.concatenate([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]])
    inside = np.concatenate([pit.facets[1:][:, [0, 2, 1]], pit.facets[1:][:, [0, 3, 2]]]) + 8
    body = Part("die", BODY_COLOR, points, np.concatenate([outside, np.array(frame), inside]))
    inlay = Part("inlay", LABEL_COLOR, pit.vertices + floor, pit.triangles)
    return Contents("inlaid", [body, inlay], {})
