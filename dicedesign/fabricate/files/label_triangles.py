"""Which triangles of a die with labels belong to the labels."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import KDTree

from dicedesign.geometry.surfaces.distances import distances_from_surface
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans

__all__ = ["label_triangles"]

OFF_SURFACE: Final = 0.1
"""Distance of the middle of a triangle from the plain surface, over the depth of labels. That of a
wall with two corners on the surface is a third of the depth away, less where the surface slopes."""


def label_triangles(marked: Surface, plain: Surface, depth: float) -> Booleans:
    """(t,) which triangles of a die with labels are walls and floors of these: those whose middles
    are not on the surface of the plain die.

    marked, plain: the die with labels and without; depth: of labels, above 0; all in one unit.
    """
    middles = marked.points[marked.triangles].mean(axis=1)
    # Most triangles of a surface of many are as they were.
    known = plain.points[plain.triangles].mean(axis=1)
    apart, _ = KDTree(known).query(middles)
    new = np.flatnonzero(apart > 0.0)
    labels = np.zeros(len(middles), dtype=bool)
    labels[new] = distances_from_surface(plain, middles[new]) > OFF_SURFACE * depth
    return labels
