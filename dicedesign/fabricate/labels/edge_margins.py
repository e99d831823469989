"""How far pockets stay from the edges of a facet, so that they break through no other facet and
meet no pocket there; the border of a sunk field is as wide."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["border_lines", "edge_margins"]

WALL: Final = 0.5
"""Distance along the facet, over the least one, that a pocket keeps from the plane which halves the
angle at an edge; the wall between it and a pocket beyond is twice as thick."""

LEAST_SINE: Final = 1e-3
"""Sine of the angle between two planes below which they count as parallel."""

SHARPEST: Final = 1e-12
"""One plus the cosine of the angle between the normals of two facets is taken for at least that."""


def edge_margins(hull: ConvexHull, facet: int, options: EngravingOptions) -> Floats:
    """Distances (m,) in mm that labels keep from the edges of a facet, in the order of its corners:
    the margin, and more along a sharp edge; from the border, where they are raised.

    hull: the die in mm; options: style, depth, margin and border.
    """
    edges = slice(int(hull.facet_start[facet]), int(hull.facet_start[facet + 1]))
    cosines = hull.normals[hull.facet[hull.twin[edges]]] @ hull.normals[facet]
    if options.style == "raised":
        return _walls(cosines, options.depth_mm, options.border_mm) + options.margin_mm
    return _walls(cosines, options.depth_mm, options.margin_mm)


def border_lines(
    hull: ConvexHull, facet: int, frame: Floats, options: EngravingOptions
) -> tuple[list[float], list[Floats]]:
    """Inner lines of the border of a sunk field, one for each plane that meets that of the facet.

    frame: (4, 4) with the facet in its plane of x and y. Returns distances in mm from the origin
    and unit directions (2,): the field lies beyond.
    """
    others = np.delete(np.arange(len(hull.normals)), facet)
    normals, heights = hull.normals[others], hull.heights(frame[:3, 3])[others]
    cosines = normals @ hull.normals[facet]
    flat = -normals @ frame[:3, :2]
    sines = np.linalg.norm(flat, axis=1)
    meets = sines > LEAST_SINE
    widths = _walls(cosines[meets], options.depth_mm, options.border_mm)
    distances = widths - heights[meets] / sines[meets]
    return distances.tolist(), list(flat[meets] / sines[meets, None])


def _walls(cosines: Floats, depth: float, least: float) -> Floats:
    """Distances (m,) of at least the least one from where two planes meet, at which pockets of a
    depth leave a wall; cosines: (m,) of the angles between their normals.

    A pocket of depth d reaches the plane that halves the angle between two facets where it comes as
    near to their edge as d tan(a / 2), for an angle a between their normals.
    """
    halves = np.sqrt((1.0 - cosines).clip(0.0) / (1.0 + cosines).clip(SHARPEST))
    sharp: Floats = depth * halves + WALL * least
    return np.maximum(least, sharp)
