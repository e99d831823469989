"""The coordinates of the forward model in another floating-point type."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.rest.basins import Basins
from dicedesign.rest.morse import (
    Separatrices,
    basin_references,
    separatrix_points,
    signed_areas,
    wraps,
)

__all__ = ["evaluated_probabilities"]


def evaluated_probabilities(
    hull: ConvexHull, sides: Sequence[Basins], dtype: type[np.floating[Any]]
) -> NDArray[np.float64]:
    """Resting probabilities with the combinatorics as found and coordinates in another type.

    The body is put in the middle of its box and scaled to half extent 1, so that no power of a
    length overflows; then corners and centers of mass are rounded and everything else is computed
    in that type.

    hull: the convex hull; sides: its basins by `find_basins`; dtype: such as `numpy.float32`.
    Returns (m,) the mean over the sides, 0 for facets that are no rests.
    """
    low, high = hull.vertices.min(axis=0), hull.vertices.max(axis=0)
    middle, scale = (low + high) / 2.0, float((high - low).max()) / 2.0
    vertices = ((hull.vertices - middle) / scale).astype(dtype)
    shares = np.zeros(len(hull.normals))
    for side in sides:
        center = ((side.equilibria.center_of_mass - middle) / scale).astype(dtype)
        normals = hull.normals[side.paths.rests].astype(dtype)
        shares[side.paths.rests] += _shares(side.paths, vertices, center, normals) / len(sides)
    return shares


def _shares(
    paths: Separatrices, vertices: NDArray[Any], center: NDArray[Any], normals: NDArray[Any]
) -> NDArray[Any]:
    if len(paths.rests) == 1:
        return np.ones(1, dtype=vertices.dtype)
    points = separatrix_points(paths, vertices, center, np)
    references = basin_references(paths, points, normals)
    signed = signed_areas(paths, points, references)
    return (signed / (4.0 * np.pi)) + wraps(signed).astype(vertices.dtype)
