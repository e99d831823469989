"""Pillars under what would be printed into the air, for printers whose slicer makes none.

Lengths are in millimetres.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers

__all__ = ["pillars"]

SPACING: Final = 2.0
"""Of the pillars, along x and y: printers bridge as much."""

FOOT: Final = 1.2
"""Width of a pillar on the bed."""

NECK: Final = 0.4
"""Width of a pillar where it touches the die, to be broken off there."""

LEAST: Final = 0.6
"""Height below which nothing is put under."""

AXES: Final = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
"""Corners of a square of width 1, counter-clockwise seen from above."""

SIDES: Final = np.array(
    [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)]
    + [
        corners
        for k in range(4)
        for corners in ((k, (k + 1) % 4, k + 4), ((k + 1) % 4, (k + 1) % 4 + 4, k + 4))
    ]
)
"""Triangles of a pillar, of the corners of its foot and then of its neck."""


def pillars(points: Floats, triangles: Integers, hanging: Booleans) -> Surface | None:
    """Bodies that stand on the bed, z = 0, and touch a die from below where it hangs over.

    Pillars stand at the nodes of a square grid above which the lowest surface of the die hangs, so
    that none goes through the die; a part that is narrower than `SPACING` may have none.

    points: (n, 3) of the die on the bed; triangles: (t, 3); hanging: (t,) which need supports.
    Returns None where there is nothing to support.
    """
    corners = points[triangles]
    if not hanging.any():
        return None
    flat = corners[hanging][..., :2].reshape(-1, 2)
    low, high = np.ceil(flat.min(axis=0) / SPACING), np.floor(flat.max(axis=0) / SPACING)
    grid = [SPACING * np.arange(a, b + 1.0) for a, b in zip(low, high, strict=True)]
    tops = []
    for place in np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2):
        heights = _heights(corners, place)
        lowest = int(np.argmin(heights))
        if hanging[lowest] and LEAST <= heights[lowest] < np.inf:
            tops.append(np.append(place, heights[lowest]))
    if not tops:
        return None
    bodies = np.stack([_pillar(top) for top in tops])
    count = np.arange(len(bodies))[:, None, None]
    return Surface(bodies.reshape(-1, 3), (SIDES + 8 * count).reshape(-1, 3))


def _heights(corners: Floats, place: Floats) -> Floats:
    """(t,) z of triangles (t, 3, 3) above a point (2,), infinite for those beside it."""
    a, b, c = (corners[:, k, :2] - place for k in range(3))
    areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
    whole = areas.sum(axis=1)
    signs = np.sign(whole)[:, None]
    over = (areas * signs >= 0.0).all(axis=1) & (whole != 0.0)
    heights = np.full(len(corners), np.inf)
    heights[over] = (areas[over] * corners[over, :, 2]).sum(axis=1) / whole[over]
    return heights


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _pillar(top: Floats) -> Floats:
    """(8, 3) corners of a pillar below a point (3,)."""
    foot = np.column_stack([top[:2] + FOOT * AXES, np.zeros(4)])
    neck = np.column_stack([top[:2] + NECK * AXES, np.full(4, top[2])])
    return np.concatenate([foot, neck])
