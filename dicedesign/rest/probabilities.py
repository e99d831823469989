"""Resting probabilities: the areas of the basins of attraction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hull import ConvexHull
from dicedesign.rest.equilibria import Equilibria, Tie, classify
from dicedesign.rest.morse import (
    Separatrices,
    basin_references,
    border_areas,
    separatrices,
    separatrix_points,
    wraps,
)
from dicedesign.tolerances import CLOSURE_TOLERANCE, TIE_TOLERANCE

__all__ = ["Basins", "closed_areas", "find_basins"]

Floats = NDArray[np.float64]

TIE_DIRECTION = np.array([0.73, 0.58, -0.36])
"""The way in which a tied body's center of mass is moved, forth and back: of length about 1 and in
no plane of symmetry that a body is likely to have."""

TIE_STEP = 4.0
"""How far, in units of the distance within which ties are looked for."""


@dataclass(frozen=True)
class Basins:
    """The basins of attraction of one body.

    Attributes
    ----------
    equilibria: the classified hull.
    paths: its separatrices.
    points: (2 s, depth + 2, 3) of their branches.
    areas: (k,) in steradian, in the order of `paths.rests`, summing to 4 pi.
    """

    equilibria: Equilibria
    paths: Separatrices
    points: Floats
    areas: Floats


def find_basins(hull: ConvexHull, center_of_mass: Floats) -> tuple[Basins, ...]:
    """The basins of a body; of a tied one, those of two bodies beside it.

    A body is tied if a move of its center of mass by `TIE_TOLERANCE` could change what it does: it
    balances on an edge, a corner or a saddle, or a path runs into such a balance or through a facet
    normal. Its mass there could fall both ways, and should fall both ways equally often, whatever
    rounding says; so its odds are defined as the mean of those with the center of mass moved a
    little further than that to one side and to the other.

    hull: the convex hull; center_of_mass: (3,) strictly inside it.

    Raises
    ------
    OutsideHullError: the center of mass is not strictly inside the hull.
    DegenerateBodyError: the basins do not close.
    """
    far = np.abs(np.concatenate([hull.vertices, center_of_mass[None]])).max()
    distance = TIE_TOLERANCE * float(far + np.ptp(hull.vertices, axis=0).max())
    try:
        return (_trace(classify(hull, center_of_mass, distance)),)
    except Tie:
        move = TIE_STEP * distance * TIE_DIRECTION
        beside = (center_of_mass + move, center_of_mass - move)
        return tuple(_trace(classify(hull, center)) for center in beside)


def _trace(equilibria: Equilibria) -> Basins:
    """Source: eq. 9, 10."""
    paths = separatrices(equilibria)
    points = separatrix_points(paths, equilibria.hull.vertices, equilibria.center_of_mass, np)
    if len(paths.rests) == 1:
        return Basins(equilibria, paths, points, np.array([4.0 * np.pi]))
    references = basin_references(paths, points, equilibria.hull.normals[paths.rests])
    border = border_areas(paths, points, references, np)
    sums = np.zeros(len(paths.rests))
    np.add.at(sums, paths.basins.ravel(), border.ravel())
    return Basins(equilibria, paths, points, closed_areas(sums))


def closed_areas(signed: Floats) -> Floats:
    """Areas (k,) of basins from their signed areas (k,), which are right up to multiples of 4 pi.

    Raises
    ------
    DegenerateBodyError: the basins do not cover the sphere once.
    """
    areas = signed + 4.0 * np.pi * wraps(signed)
    gap = abs(float(areas.sum()) - 4.0 * np.pi)
    if not (gap <= CLOSURE_TOLERANCE and (areas > 0.0).all()):
        raise DegenerateBodyError(
            f"body: expected basins that cover the sphere once, got a difference of {gap:.3g} "
            "steradian; its facets are flat only within the coplanar tolerance, so give a smaller "
            "or larger one"
        )
    return areas
