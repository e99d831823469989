"""How far pockets stay from the edges of a facet, so that they break through no other facet and
meet no pocket there; the border of a sunk field is as wide."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["border_widths", "edge_margins"]

WALL: Final = 0.5
"""Distance along the facet, over the least one, that a pocket keeps from the plane which halves the angle
at an edge; the wall between it and a pocket beyond is twice as thick."""

SHARPEST: Final = 1e-12
"""One plus the cosine of the angle between the normals of two facets is taken for at least that."""


def edge_margins(hull: ConvexHull, facet: int, options: EngravingOptions) -> Floats:
    """Distances (m,) in mm that labels keep from the edges of a facet, in the order of its corners:
    the margin, and more along a sharp edge; from the border, where they are raised.

    hull: the die in mm; options: style, depth, margin and border.
    """
    if options.style == "raised":
        return border_widths(hull, facet, options) + options.margin_mm
    return _distances(hull, facet, options.depth_mm, options.margin_mm)


def border_widths(hull: ConvexHull, facet: int, options: EngravingOptions) -> Floats:
    """Widths (m,) in mm of the border of a sunk field along the edges of a facet."""
    return _distances(hull, facet, options.depth_mm, options.border_mm)


def _distances(hull: ConvexHull, facet: int, depth: float, least: float) -> Floats:
    """Distances (m,) of at least the least one at which pockets of a depth leave a wall.

    A pocket of depth d reaches the plane that halves the angle between two facets where it comes as
    near to their edge as d tan(a / 2), for an angle a between their normals.
    """
    edges = slice(int(hull.facet_start[facet]), int(hull.facet_start[facet + 1]))
    cosines = hull.normals[hull.facet[hull.twin[edges]]] @ hull.normals[facet]
    halves = np.sqrt((1.0 - cosines).clip(0.0) / (1.0 + cosines).clip(SHARPEST))
    sharp: Floats = depth * halves + WALL * least
    return np.maximum(least, sharp)
