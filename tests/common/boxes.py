"""Boxes with closed-form probabilities and depths, straight or sheared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface

CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def box(sizes: Sequence[float], lean: Sequence[float] = (0.0, 0.0, 0.0)) -> Surface:
    """Box with a corner at the origin. sizes: (3,); lean: (3,) shift of the top."""
    points = CORNERS * sizes + CORNERS[:, 2:] * np.array(lean)
    hull = convex_hull(points)
    return hull.surface
