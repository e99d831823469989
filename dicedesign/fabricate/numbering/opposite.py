"""Facets that lie opposite to each other."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.arrays import Integers
from dicedesign.tolerances import LEVEL_ANGLE

__all__ = ["opposite_facets"]


def opposite_facets(hull: ConvexHull, facets: Integers) -> Integers:
    """(k,) facets of a hull that are level on top while it rests on facets (k,), or -1 where the
    nearest to that leans by more than `LEVEL_ANGLE`."""
    angles = angle_between(-hull.normals[facets][:, None], hull.normals[None])
    nearest = angles.argmin(axis=1)
    level = angles[np.arange(len(facets)), nearest] <= LEVEL_ANGLE
    return np.where(level, nearest, -1)
