"""Few places where a surface meets itself, smoothed until it does not."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import sums_by_index

__all__ = ["untangled"]

MOST: Final = 300
"""Pairs of triangles that meet, from which on that is hopeless."""

ROUNDS: Final = 8
"""Times that the places are looked for."""

SMOOTHINGS: Final = 3
"""Times that their points are moved each time."""

RINGS: Final = 1
"""Of points around those of triangles that meet, moved with them."""


def untangled(surface: Surface) -> Surface | None:
    """The surface with points around triangles that meet moved to the mean of their neighbors,
    again and again and wider, until no two meet; None where some still do in the end."""
    points, triangles = surface.points.copy(), surface.triangles
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    near = np.zeros(len(points), dtype=bool)
    for _ in range(ROUNDS):
        pairs = intersecting_triangles(points, triangles)
        if len(pairs) == 0:
            return surface.moved(points)
        if len(pairs) > MOST:
            break
        near[triangles[pairs]] = True
        for _ in range(RINGS):
            near[heads[near[tails]]] = True
        # Each edge of a closed surface is there once each way.
        edges = np.flatnonzero(near[tails])
        count = np.bincount(tails[edges], minlength=len(points))[near]
        for _ in range(SMOOTHINGS):
            sums = sums_by_index(tails[edges], points[heads[edges]], len(points))[near]
            points[near] = sums / count[:, None]
    return None
