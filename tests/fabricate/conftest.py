"""Boxes with known facets, plain and with labels cut in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from dicedesign.fabricate.engraving import engrave, labels_below_hull
from dicedesign.fabricate.file_formats import BODY_COLOR, LABEL_COLOR, Contents, Part
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import LabelPlace, place_labels
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.triangles import Surface


@dataclass
class Box:
    """A box about the origin: +z, -z, +x, -x, +y, -y facets, counter-clockwise from outside."""

    vertices: np.ndarray
    facets: np.ndarray
    normals: np.ndarray

    @property
    def triangles(self) -> np.ndarray:
        return np.concatenate([self.facets[:, [0, 1, 2]], self.facets[:, [0, 2, 3]]])

    @property
    def surface(self) -> Surface:
        return Surface(self.vertices, self.triangles)

    @property
    def polygons(self) -> list[np.ndarray]:
        return [self.vertices[facet] for facet in self.facets]

    @property
    def size_mm(self) -> float:
        return 2 * float(np.linalg.norm(self.vertices[0]))

    def places(self, texts: list[str]) -> list[LabelPlace]:
        """Labels on its first facets."""
        return [
            LabelPlace(text, number, number, polygon, normal)
            for number, (text, polygon, normal) in enumerate(
                zip(texts, self.polygons, self.normals, strict=False)
            )
        ]

    def with_points(self, rotation: np.ndarray, factor: float = 1.0) -> Box:
        return Box(factor * self.vertices @ rotation.T, self.facets, self.normals @ rotation.T)


@pytest.fixture
def box():
    def make(x: float, y: float, z: float) -> Box:
        signs = np.array([(a, b, c) for c in (-1, 1) for b in (-1, 1) for a in (-1, 1)])
        facets = np.array(
            [(4, 5, 7, 6), (0, 2, 3, 1), (1, 3, 7, 5), (0, 4, 6, 2), (2, 6, 7, 3), (0, 1, 5, 4)]
        )
        normals = np.array([(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
        return Box(0.5 * signs * (x, y, z), facets, normals.astype(float))

    return make


FACTS = {
    "Application": "dicedesign 7",
    "Description": "Less than <2> outcomes & 'more' or \"more\".",
    "Target": '{"1": 0.5, "2": 0.5}',
    "Recipe": "name: box\ntarget:\n  fair: 2\n# \N{DEGREE SIGN}\n",
}


@pytest.fixture
def placements(box):
    body = box(14.0, 16.0, 20.0)
    return place_labels(body.places(["1", "8", "6."]), EngravingOptions(), body.size_mm)


@pytest.fixture
def contents(box, placements) -> Contents:
    """A box of 14, 16 and 20 mm with three labels."""
    body, options = box(14.0, 16.0, 20.0), EngravingOptions()
    marked = engrave(body.surface, placements, options)
    labels = labels_below_hull(marked, options.depth_mm)
    part = Part(marked.points, marked.triangles, "die", BODY_COLOR, labels)
    return Contents("box & co", [part], FACTS)


@pytest.fixture
def inlaid(box) -> Contents:
    """A box of 10 mm with a pit of 4 mm in its top, and a block that fills the pit."""
    outer, pit = box(10.0, 10.0, 10.0), box(4.0, 4.0, 4.0)
    places = pit.vertices + np.array([0.0, 0.0, 3.0])
    whole = mesh_of(solid(outer.surface) - solid(Surface(places, pit.triangles)))
    body = Part(whole.points, whole.triangles, "die", BODY_COLOR)
    inlay = Part(places, pit.triangles, "inlay", LABEL_COLOR)
    return Contents("inlaid", [body, inlay], {})
