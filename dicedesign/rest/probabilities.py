"""Resting probabilities of a classified hull."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import DegenerateBodyError
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.morse import Separatrices, border_areas, separatrix_points, wraps
from dicedesign.tolerances import CLOSURE_TOLERANCE

__all__ = ["basin_areas"]

Floats = NDArray[np.float64]


def basin_areas(equilibria: Equilibria, paths: Separatrices) -> tuple[Floats, Floats]:
    """Areas of the basins of attraction of all rests, and the points of the separatrices.

    Returns areas (k,) in steradian, in the order of `paths.rests`, summing to 4 pi, and the points
    (2 s, depth + 2, 3) of the branches.

    Raises
    ------
    DegenerateBodyError: the basins do not close, which happens where a path runs exactly into a
        balance point.

    Source: eq. 9, 10.
    """
    points = separatrix_points(paths, equilibria.hull.vertices, equilibria.center_of_mass, np)
    if len(paths.rests) == 1:
        return np.array([4.0 * np.pi]), points
    normals = equilibria.hull.normals[paths.rests]
    border = border_areas(paths, points, normals, np)
    sums = np.bincount(paths.basins.ravel(), weights=border.ravel(), minlength=len(paths.rests))
    signed = sums.astype(np.float64)
    areas = signed + 4.0 * np.pi * wraps(signed)
    gap = abs(float(areas.sum()) - 4.0 * np.pi)
    if gap > CLOSURE_TOLERANCE or (areas <= 0.0).any():
        raise DegenerateBodyError(
            f"body: its basins should cover the sphere once but differ by {gap:.3g} steradian; a "
            "rolling path meets a balance point exactly, so symmetric is the body. Move the "
            "center of mass by a hair (--com x,y,z) to break the tie"
        )
    return areas, points
