"""The surface of a body without what is finer than its triangles."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter, label, map_coordinates

from dicedesign.concave.distance_functions import Distance, level_set
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats

__all__ = ["soft_surface"]

CELLS: Final = 48
"""Of a coarse grid along each axis, in which a body is found and its area is estimated."""

SOFTNESS: Final = 1.0
"""Width, in cells, of the bell over which distances are averaged."""


def soft_surface(distance: Distance, reach: float, count: int) -> Surface | None:
    """The surface of the largest piece of a body, its distances averaged over the size of its
    triangles, so that creases are rounded and thin parts and gaps go; None where it nearly touches
    itself.

    distance: negative inside; reach: largest coordinate of the body along any axis; count: of its
    points, about.
    """
    axis, cell = np.linspace(-reach, reach, CELLS + 1, retstep=True)
    inside = distance(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)) < 0.0
    places = np.stack(np.nonzero(inside), axis=1)
    crossings = sum(np.count_nonzero(np.diff(inside, axis=k)) for k in range(3))
    # The surface has about as many points as edges of the grid cross it.
    spacing = float(cell * np.sqrt(crossings / count))
    low = axis[places.min(axis=0)] - cell - 3.0 * spacing
    high = axis[places.max(axis=0)] + cell + 3.0 * spacing
    values = _averaged(distance, low, high, spacing)
    if _is_ambiguous(values < 0.0):
        return None
    return level_set(_interpolation(values, low, spacing), low, high, spacing)


def _averaged(distance: Distance, low: Floats, high: Floats, spacing: float) -> Floats:
    """Distances at the points of a grid, averaged over their surroundings, negative in the largest
    piece alone."""
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    values = distance(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    averaged: Floats = gaussian_filter(values, SOFTNESS)
    pieces = label(averaged < 0.0)[0]
    largest = np.bincount(pieces.ravel())[1:].argmax() + 1
    averaged[(pieces != largest) & (averaged < 0.0)] = spacing
    return averaged


def _is_ambiguous(inside: Booleans) -> bool:
    """Whether some square of a grid has just two opposite corners inside: there sheets meet."""
    for axis in range(3):
        layers = np.moveaxis(inside, axis, 0)
        a, b = layers[:, :-1, :-1], layers[:, 1:, 1:]
        c, d = layers[:, 1:, :-1], layers[:, :-1, 1:]
        if ((a == b) & (c == d) & (a != c)).any():
            return True
    return False


def _interpolation(values: Floats, low: Floats, spacing: float) -> Distance:
    """Values at the points of a grid, and linearly between them."""

    def distance(points: Floats) -> Floats:
        places = np.moveaxis((points - low) / spacing, -1, 0)
        found: Floats = map_coordinates(values, places, order=1, mode="nearest")
        return found

    return distance
