"""Bodies with known facets for the tests of engraving."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest


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
    def polygons(self) -> list[np.ndarray]:
        return [self.vertices[facet] for facet in self.facets]

    @property
    def size_mm(self) -> float:
        return 2 * float(np.linalg.norm(self.vertices[0]))

    def moved(self, rotation: np.ndarray, factor: float = 1.0) -> Box:
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
