"""Some corners of a surface's hull that tell its shape, where there are many.

The odds are a matter of the whole hull, and so is its design: a few hundred corners that are moved
smoothly do as well as thousands. The surface follows them at its full resolution.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.concave.fill.space_elasticity import spread_points
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["coarse_corners"]

SPREAD: Final = 60
"""Corners that are taken first, as far from each other as can be."""

MOST_CORNERS: Final = 300
"""Corners beyond which none is added."""

CLOSE: Final = 1e-3
"""Distance of the corners that are left out from the hull of the others, over the circumscribed
radius, at which it is near enough."""


def coarse_corners(hull: ConvexHull) -> Integers:
    """The rising numbers (c,) of corners of a hull whose own hull is near to it.

    hull: of circumscribed radius about 1. Those that stick out farthest from the hull of the others
    are taken in turn, one above each facet at a time.
    """
    corners = hull.vertices
    if len(corners) <= SPREAD:
        return np.arange(len(corners))
    chosen = spread_points(corners, SPREAD)
    while True:
        coarse = convex_hull(corners[chosen])
        middle = coarse.vertices.mean(axis=0)
        above = (corners - middle) @ coarse.normals.T - coarse.heights(middle)
        facet = above.argmax(axis=1)
        height = above[np.arange(len(corners)), facet]
        height[chosen] = 0.0
        farthest = _farthest_of_each(facet, height)[: MOST_CORNERS - len(chosen)]
        if len(farthest) == 0:
            return np.sort(chosen)
        chosen = np.concatenate([chosen, farthest])


def _farthest_of_each(facet: Integers, height: Floats) -> Integers:
    """Of the points (n,) above each facet the highest, the highest of all first."""
    order = np.argsort(-height, kind="stable")
    order = order[height[order] > CLOSE]
    first = np.sort(np.unique(facet[order], return_index=True)[1])
    return order[first]
