"""Models made at random that nobody tuned to, as surfaces to be made into dice.

Each is closed, one piece, does not meet itself, has between 1,500 and 4,000 points, at most three
tunnels, and leaves at least a sixth of its hull empty. A name gives the same model each time; last
bits of its coordinates may differ between processors.
"""

from __future__ import annotations

from itertools import islice, product
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter, label, map_coordinates

from dicedesign.bench.bodies.model_kinds import KINDS
from dicedesign.concave.shapes.distance_functions import Distance
from dicedesign.concave.shapes.level_set import level_set
from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats

__all__ = ["MODELS", "model_names", "random_model"]

SEED: Final = 2024
"""Of all random models."""

REACH: Final = 4.0
"""All models lie within it of the origin, along each axis."""

CELLS: Final = 48
"""Of a coarse grid along each axis, in which a model is found and its area is estimated."""

SOFTNESS: Final = 1.0
"""Width, in cells, of the bell over which distances are averaged."""

POINTS: Final = (1500, 4000)
"""Fewest and most points of a model."""

FILL: Final = (0.02, 5.0 / 6.0)
"""Least and largest part of its hull that a model fills."""

MOST_TUNNELS: Final = 3


def model_names(count: int) -> tuple[str, ...]:
    """The names of the first models: kinds take turns."""
    every = product(range(1, count + 1), KINDS)
    return tuple(f"{kind}_{number:02d}" for number, kind in islice(every, count))


MODELS: Final = model_names(40)
"""Names of the models of the bench."""


def random_model(name: str) -> Surface:
    """The model of a name such as blobs_03: a kind, and a number from 1 on.

    Raises InputError for another name.
    """
    kind, _, digits = name.rpartition("_")
    if kind not in KINDS or not digits.isdecimal() or int(digits) < 1:
        raise InputError(
            f"model: expected one of {', '.join(KINDS)} with a number, got {name!r}; write it such "
            f"as {MODELS[0]}"
        )
    rng = np.random.default_rng([SEED, tuple(KINDS).index(kind), int(digits)])
    while True:
        surface = _meshed(KINDS[kind](rng), int(rng.integers(1700, 3600)))
        if surface is not None and _is_good(surface):
            return surface


def _meshed(distance: Distance, count: int) -> Surface | None:
    """About as many points as asked for, evenly on the surface of a body; None where it touches
    itself."""
    axis, cell = np.linspace(-REACH, REACH, CELLS + 1, retstep=True)
    inside = distance(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)) < 0.0
    places = np.stack(np.nonzero(inside), axis=1)
    crossings = sum(np.count_nonzero(np.diff(inside, axis=k)) for k in range(3))
    # A surface of a grid has about as many points as edges of the grid cross it.
    spacing = float(cell * np.sqrt(crossings / count))
    low = axis[places.min(axis=0)] - cell - 3.0 * spacing
    high = axis[places.max(axis=0)] + cell + 3.0 * spacing
    values = _softened(distance, low, high, spacing)
    return (
        None
        if _is_ambiguous(values < 0.0)
        else level_set(_between(values, low, spacing), low, high, spacing)
    )


def _softened(distance: Distance, low: Floats, high: Floats, spacing: float) -> Floats:
    """The largest piece of a body, without creases, parts and gaps that are thinner than the cells
    of a grid."""
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    values = distance(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    values = gaussian_filter(values, SOFTNESS)
    pieces = label(values < 0.0)[0]
    largest = np.bincount(pieces.ravel())[1:].argmax() + 1
    values[(pieces != largest) & (values < 0.0)] = spacing
    return values


def _is_ambiguous(inside: Booleans) -> bool:
    """Whether some square of a grid has just two opposite corners inside: there sheets meet."""
    for axis in range(3):
        square = np.moveaxis(inside, axis, 0)
        a, b = square[:, :-1, :-1], square[:, 1:, 1:]
        c, d = square[:, 1:, :-1], square[:, :-1, 1:]
        if ((a == b) & (c == d) & (a != c)).any():
            return True
    return False


def _between(values: Floats, low: Floats, spacing: float) -> Distance:
    """Values at the points of a grid, and between them."""

    def distance(points: Floats) -> Floats:
        places = np.moveaxis((points - low) / spacing, -1, 0)
        found: Floats = map_coordinates(values, places, order=1, mode="nearest")
        return found

    return distance


def _is_good(surface: Surface) -> bool:
    points, triangles = surface.points, surface.triangles
    if not POINTS[0] <= len(points) <= POINTS[1]:
        return False
    try:
        make_surface(make_body(points, triangles, "model"))
    except (InputError, DegenerateBodyError):
        return False
    tunnels = 1 - (len(points) - len(triangles) // 2) // 2
    hull = convex_hull(points)
    fill = surface.volume / Surface(hull.vertices, hull.triangles).volume
    return tunnels <= MOST_TUNNELS and FILL[0] <= fill <= FILL[1]
