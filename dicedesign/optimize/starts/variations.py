"""A starting shape, and variations of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Final

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.coordinates.facets import Coordinates, FacetCoordinates
from dicedesign.optimize.coordinates.linked import PinnedCoordinates, SymmetricCoordinates
from dicedesign.optimize.starts.start import Start
from dicedesign.runtime.arrays import Floats

FIRST_VARIATION: Final = 0.01
"""Size of the first variation of a start: a standard deviation of normals, and of the logarithms of
distances."""

LARGEST_VARIATION: Final = 0.3
"""Size that variations approach."""


def shapes_like(
    start: Start, seed: int, group: Floats | None = None, *, any_order: bool = False
) -> Iterator[Start]:
    """A start, and then the same with its facets turned and shifted more and more, without end;
    pinned ones stay.

    Where that leaves no solid, the next one follows.

    Parameters
    ----------
    start: the shape.
    seed: of the variations.
    group: (g, 3, 3) a point group about the origin that the start has as symmetry, and that its
        variations are to keep, or None.
    any_order: each variation has its outcomes on the facets in a random order.

    Raises
    ------
    InputError: the start does not have the symmetry.
    """
    yield start
    hull = convex_hull(start.points)
    coordinates: Coordinates
    if group is not None:
        coordinates, parameters = SymmetricCoordinates.of(start.points, hull.centroid, group)
    elif start.pinned:
        pinned = start.directions[list(start.pinned)]
        coordinates, parameters = PinnedCoordinates.of(start.points, hull.centroid, pinned)
    else:
        coordinates, parameters = FacetCoordinates.of(start.points, hull.centroid)
    facets = np.argmax(start.directions @ hull.normals.T, axis=1)
    rng = np.random.default_rng(seed)
    for number in count(1):
        size = LARGEST_VARIATION * (1.0 - np.exp(-number * FIRST_VARIATION / LARGEST_VARIATION))
        moved = parameters + size * rng.normal(size=parameters.shape)
        try:
            points = coordinates.shape(moved).points
            normals = convex_hull(points).normals
        except (DiceError, np.linalg.LinAlgError):
            continue
        nearest = np.argmax(hull.normals[facets] @ normals.T, axis=1)
        if any_order:
            nearest = rng.permutation(nearest)
        yield replace(start, points=points, directions=normals[nearest])
