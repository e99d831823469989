"""How far pockets stay from the edges of a facet, so that they break through no other facet and
meet no pocket there."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["edge_margins"]

WALL: Final = 0.5
"""Distance along the facet, in margins, that a pocket keeps from the plane which halves the angle
at an edge; the wall between it and a pocket beyond is twice as thick."""

SHARPEST: Final = 1e-12
"""One plus the cosine of the angle between the normals of two facets is taken for at least that."""


def edge_margins(hull: ConvexHull, facet: int, options: EngravingOptions) -> Floats:
    """Distances (m,) in mm that labels keep from the edges of a facet, in the order of its corners:
    the margin, and more along a sharp edge.

    A pocket of depth d reaches the plane that halves the angle between two facets where it comes as
    near to their edge as d tan(a / 2), for an angle a between their normals.

    hull: the die in mm; options: depth and margin.
    """
    edges = slice(int(hull.facet_start[facet]), int(hull.facet_start[facet + 1]))
    cosines = hull.normals[hull.facet[hull.twin[edges]]] @ hull.normals[facet]
    halves = np.sqrt((1.0 - cosines).clip(0.0) / (1.0 + cosines).clip(SHARPEST))
    sharp: Floats = options.depth_mm * halves + WALL * options.margin_mm
    return np.maximum(options.margin_mm, sharp)
