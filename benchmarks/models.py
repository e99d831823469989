"""Models made at random that nobody tuned to, as surfaces to be made into dice.

Each is closed, one piece, does not meet itself, has between 1,500 and 4,000 points, at most three
tunnels, and leaves at least a sixth of its hull empty. A name gives the same model each time; last
bits of its coordinates may differ between processors.
"""

from __future__ import annotations

from itertools import islice, product

import numpy as np
from manifold3d import Manifold
from scipy.ndimage import gaussian_filter, label, map_coordinates

from benchmarks.model_kinds import REACH, ROUND_KINDS
from dicedesign.concave.shapes import Distance, level_set
from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.surfaces.closed_surface import make_surface, refine
from dicedesign.geometry.triangles import Surface, doubled_area_vectors
from dicedesign.runtime.arrays import Booleans, Floats

SEED = 2024
"""Of all random models."""

MODEL_KINDS = (*ROUND_KINDS, "blocks")
"""Kinds, which take turns."""

POINTS = (1500, 4000)
"""Fewest and most points of a model."""

FILL = (0.02, 5.0 / 6.0)
"""Least and largest part of its hull that a model fills."""

MOST_TUNNELS = 3
"""Of a model."""


def model_names(count: int) -> tuple[str, ...]:
    """The names of the first models."""
    every = product(range(1, count + 1), MODEL_KINDS)
    return tuple(f"{kind}_{number:02d}" for number, kind in islice(every, count))


MODELS = model_names(40)
"""Names of the models of the bench."""


def is_model(name: str) -> bool:
    """Whether a name is that of a model: a kind, and a number of two digits from 1 on, or more."""
    kind, _, digits = name.rpartition("_")
    return kind in MODEL_KINDS and digits == f"{_number(digits):02d}" != "00"


def random_model(name: str) -> Surface:
    """The model of a name such as blobs_03. Raises InputError for one that is no model's."""
    if not is_model(name):
        raise InputError(
            f"model: expected one of {', '.join(MODEL_KINDS)} with a number, got {name!r}; write "
            f"it such as {MODELS[0]}"
        )
    kind, _, digits = name.rpartition("_")
    rng = np.random.default_rng([SEED, MODEL_KINDS.index(kind), int(digits)])
    while True:
        surface = _draw_surface(kind, rng)
        if surface is not None and _is_good(surface):
            return surface


HOLES, HOLE_REACH = 3, 0.04
"""Number of holes in a broken model, and their radius over the diagonal."""


def break_surface(surface: Surface, seed: int) -> Surface:
    """Triangles like those of careless downloads: three round holes, a ball that is stuck through
    the surface as a part of its own, another inside as an inner wall, and one triangle in fifty
    twice."""
    random, points, triangles = np.random.default_rng(seed), surface.points, surface.triangles
    middles, diagonal = points[triangles].mean(axis=1), surface.diagonal
    holes = middles[random.choice(len(middles), HOLES)]
    distances = norms(middles[:, None] - holes).min(axis=1)
    kept = triangles[distances > HOLE_REACH * diagonal]
    kept = np.concatenate([kept, random.choice(kept, len(kept) // 50)])
    ball = mesh_of(Manifold.sphere(1.0, 24))
    place = int(random.integers(len(kept)))
    outside = points[kept[place]].mean(axis=0)
    inward = -unit_vectors(doubled_area_vectors(points, kept[place, None])[0])
    through, inside = (
        diagonal * (radius * ball.points + depth * inward) + outside
        for radius, depth in ((0.05, 0.01), (0.01, 0.02))
    )
    first, second = len(points), len(points) + len(ball.points)
    return Surface(
        np.concatenate([points, through, inside]),
        np.concatenate([kept, ball.triangles + first, ball.triangles + second]),
    )


def _number(digits: str) -> int:
    return int(digits) if digits.isascii() and digits.isdecimal() else 0


def _draw_surface(kind: str, rng: np.random.Generator) -> Surface | None:
    """A surface of a kind, good or not; None where there is none."""
    count = int(rng.integers(1700, 3600))
    if kind in ROUND_KINDS:
        return soft_surface(ROUND_KINDS[kind](rng), REACH, count)
    try:
        return blocks(rng, count)
    except InputError:
        return None


def _is_good(surface: Surface) -> bool:
    """Whether it is as every model is."""
    points, triangles = surface.points, surface.triangles
    hull = convex_hull(points)
    fill = surface.volume / hull.surface.volume
    tunnels = 1 - (len(points) - len(triangles) // 2) // 2
    if not (POINTS[0] <= len(points) <= POINTS[1] and FILL[0] <= fill <= FILL[1]):
        return False
    if tunnels > MOST_TUNNELS:
        return False
    try:
        make_surface(make_body(points, triangles, "model"))
    except (InputError, DegenerateBodyError):
        return False
    return True


def blocks(rng: np.random.Generator, count: int) -> Surface:
    """Two to five solids of few faces as one, and up to two bores.

    Its large faces have long triangles, as those of drawn solids do. count: least number of points.
    Raises InputError where they do not make a good surface.
    """
    body = Manifold.cube(tuple(rng.uniform([1.0, 0.5, 0.3], [2.2, 1.2, 0.9])), True)
    low, high = np.split(np.array(body.bounding_box()), 2)
    for _ in range(int(rng.integers(1, 5))):
        place = rng.uniform(0.8 * low, 0.8 * high)
        if rng.random() < 0.5:
            part = Manifold.cube(tuple(rng.uniform([0.3, 0.3, 0.6], [0.8, 0.8, 2.0])), True)
        else:
            wide, narrow = rng.uniform([0.25, 0.12], [0.6, 0.5])
            sides = int(rng.integers(3, 10))
            part = Manifold.cylinder(rng.uniform(0.6, 2.0), wide, narrow, sides, True)
        if rng.random() < 0.5:
            part = part.rotate(tuple(rng.uniform(-90.0, 90.0, size=3)))
        body += part.translate(tuple(place))
    for _ in range(int(rng.integers(0, 3))):
        bore = Manifold.cylinder(6.0, rng.uniform(0.12, 0.25), -1.0, 8, True)
        angles = 90.0 * rng.integers(0, 2, size=3)
        body -= bore.rotate(tuple(angles)).translate(tuple(rng.uniform(0.6 * low, 0.6 * high)))
    return refine(mesh_of(body), count)[0]


CELLS = 48
"""Of a coarse grid along each axis, in which a body is found and its area is estimated."""

SOFTNESS = 1.0
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
    values = _average(distance, low, high, spacing)
    if _is_ambiguous(values < 0.0):
        return None
    return level_set(_interpolation(values, low, spacing), low, high, spacing)


def _average(distance: Distance, low: Floats, high: Floats, spacing: float) -> Floats:
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
        interpolated: Floats = map_coordinates(values, places, order=1, mode="nearest")
        return interpolated

    return distance
