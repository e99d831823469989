"""Boxes, whose probabilities and depths have closed forms, and a leaning one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface

CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def box(sizes: Sequence[float], lean: Sequence[float] = (0.0, 0.0, 0.0)) -> Surface:
    """From the origin, of sizes (3,), its top pushed aside by (3,)."""
    points = CORNERS * sizes + CORNERS[:, 2:] * np.array(lean)
    hull = convex_hull(points)
    return Surface(hull.vertices, hull.triangles)
