"""The point within a hull at which a center of mass that is dragged out of it stays."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["nearest_inside"]

CLEARANCE: Final = 1e-3
"""Part of the way from the centroid to the surface at which a center stays."""


def nearest_inside(hull: ConvexHull, point: Floats) -> tuple[Floats, bool]:
    """A point (3,), or the last one within a hull on the straight way to it from the hull's
    centroid, a little below the surface; and whether the point was inside.

    Raises InputError: the point is not three finite numbers.
    """
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError(
            f"center of mass: expected three finite numbers, got {point.tolist()}; type numbers"
        )
    depths = hull.heights(hull.centroid)
    # How much of each facet's depth the way uses up.
    used = 1.0 - hull.heights(point) / depths
    most = float(used.max())
    if most <= 1.0 - CLEARANCE:
        return point, True
    way = (1.0 - CLEARANCE) / most
    return hull.centroid + way * (point - hull.centroid), False
