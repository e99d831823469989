"""Boxes with known facets, plain and with labels cut in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest

from dicedesign.fabricate.engraving import engrave, labels_below_hull
from dicedesign.fabricate.file_formats import Contents, Part
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import place_labels
from dicedesign.fabricate.label_reading import LabelPlace
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.triangles import Surface
from dicedesign.palette import BLANK, INK


@dataclass
class Box:
    """A box about the origin: +z, -z, +x, -x, +y, -y facets, counter-clockwise from outside."""

    vertices: np.ndarray
    normals: np.ndarray

    @property
    def surface(self) -> Surface:
        return Surface(self.vertices, np.concatenate([FACETS[:, [0, 1, 2]], FACETS[:, [0, 2, 3]]]))

    @property
    def polygons(self) -> list[np.ndarray]:
        return [self.vertices[facet] for facet in FACETS]

    @property
    def size_mm(self) -> float:
        return 2 * float(np.linalg.norm(self.vertices[0]))

    def places(self, texts: Sequence[str]) -> list[LabelPlace]:
        """Labels on its first facets."""
        known = zip(texts, self.polygons, self.normals, strict=False)
        return [LabelPlace(text, k, k, *where) for k, (text, *where) in enumerate(known)]

    def with_points(self, rotation: np.ndarray, factor: float = 1.0) -> Box:
        return Box(factor * self.vertices @ rotation.T, self.normals @ rotation.T)


FACETS = np.array(
    [(4, 5, 7, 6), (0, 2, 3, 1), (1, 3, 7, 5), (0, 4, 6, 2), (2, 6, 7, 3), (0, 1, 5, 4)]
)


@pytest.fixture
def box() -> Callable[..., Box]:
    def make(x: float, y: float, z: float) -> Box:
        signs = np.array(list(product((-1.0, 1.0), repeat=3)))[:, ::-1]
        normals = np.stack([np.eye(3), -np.eye(3)], axis=1).reshape(-1, 3)
        return Box(0.5 * signs * (x, y, z), normals[[4, 5, 0, 1, 2, 3]])

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
    part = Part(marked.points, marked.triangles, "die", BLANK, labels)
    return Contents("box & co", [part], FACTS)


@pytest.fixture
def inlaid(box) -> Contents:
    """A box of 10 mm with a pit of 4 mm in its top, and a block that fills the pit."""
    outer, pit = box(10.0, 10.0, 10.0), box(4.0, 4.0, 4.0)
    places = pit.vertices + np.array([0.0, 0.0, 3.0])
    whole = mesh_of(solid(outer.surface) - solid(Surface(places, pit.surface.triangles)))
    body = Part(whole.points, whole.triangles, "die", BLANK)
    inlay = Part(places, pit.surface.triangles, "inlay", INK)
    return Contents("inlaid", [body, inlay], {})
