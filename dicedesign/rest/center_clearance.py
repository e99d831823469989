"""A center of mass within its hull: how near the boundary is, and how large everything is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.kernels import ops as kernels

__all__ = ["Surroundings", "surroundings"]


class Surroundings(NamedTuple):
    """Lengths that decisions about a body are measured by.

    Attributes
    ----------
    facet: the one whose plane lies lowest above the center of mass.
    height: how far, negative where the center is outside.
    offset: largest difference of a coordinate of a vertex from the mean of all vertices.
    far: largest coordinate of vertices and center of mass.
    extent: largest extent of the vertices along an axis.
    """

    facet: int
    height: float
    offset: float
    far: float
    extent: float


def surroundings(hull: ConvexHull, center: NDArray[np.float64]) -> Surroundings:
    """The surroundings of a center of mass (3,) in a hull."""
    lengths = kernels.surroundings(hull, center)
    if lengths is not None:
        return Surroundings(*lengths)
    heights = hull.heights(center)
    lowest = int(np.argmin(heights))
    return Surroundings(
        lowest,
        float(heights[lowest]),
        float(np.abs(hull.vertices - hull.vertices.mean(axis=0)).max()),
        max(float(np.abs(hull.vertices).max()), float(np.abs(center).max())),
        float(np.ptp(hull.vertices, axis=0).max()),
    )
