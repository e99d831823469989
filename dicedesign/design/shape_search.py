"""Starting shapes for any target: random polyhedra, the nearest in their odds first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.starts import (
    FEWEST_FACETS,
    Start,
    normalised_start,
    repulsion,
    spread_directions,
)
from dicedesign.errors import DiceError
from dicedesign.geometry.halfspaces import polyhedron_corners
from dicedesign.geometry.hull import convex_hull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.rest.equilibria import classify
from dicedesign.rest.probabilities import find_basins

__all__ = ["shapes_like", "shapes_near"]

Floats = NDArray[np.float64]

EVEN_SHAPES: Final = 2
"""Shapes of equal facets that are proposed first, where there are enough outcomes."""

FIRST_DRAW: Final = 50
"""Polyhedra drawn before the first of them is proposed."""

DRAW_GROWTH: Final = 1.5
"""How many times as large each later draw is."""

PROPOSED: Final = 3
"""How many of all that were drawn are proposed after each draw."""

REPULSION_STEPS: Final = 10
"""Steps that keep random facets from lying too close to each other."""

UNEVENNESS: Final = 0.6
"""Largest standard deviation of the logarithms of facet distances."""

NEARNESS: Final = 1.5
"""A facet in favour is nearer than others by a factor of up to the exponential of this."""

FIRST_VARIATION: Final = 0.01
"""Size of the first variation of a start: a standard deviation of normals, and of the logarithms of
distances."""

LARGEST_VARIATION: Final = 0.3
"""Size that variations approach."""

STRETCH: Final = (-1.5, 1.0)
"""Range of the logarithm by which a polyhedron is stretched along one axis."""


def shapes_like(start: Start, seed: int) -> Iterator[Start]:
    """A start, and then the same with its facets turned and shifted more and more, without end.

    Where that leaves no solid, the next one follows.
    """
    yield start
    hull = convex_hull(start.points)
    middle, heights = hull.centroid, hull.heights(hull.centroid)
    rng = np.random.default_rng(seed)
    for number in count(1):
        size = LARGEST_VARIATION * (1.0 - np.exp(-number * FIRST_VARIATION / LARGEST_VARIATION))
        normals = hull.normals + size * rng.normal(size=hull.normals.shape)
        try:
            points = polyhedron_corners(
                normals, heights * np.exp(size * rng.normal(size=len(heights)))
            )
        except DiceError:
            continue
        turned = normals[np.argmax(start.directions @ hull.normals.T, axis=1)]
        yield replace(start, points=points + middle, directions=unit_vectors(turned))


def shapes_near(target: Floats, seed: int) -> Iterator[Start]:
    """Starting shapes with one rest for each outcome and no other, without end.

    First come tangential polyhedra of evenly spread facets, one for each outcome; then random
    polyhedra, some facets of which are no rests, the nearest in their sorted probabilities first,
    with the largest rest for the largest outcome and so on.

    target: (k,) wanted probabilities, k at least 2; seed: of everything random.
    """
    outcomes = len(target)
    rng = np.random.default_rng(seed)
    if outcomes >= FEWEST_FACETS:
        for number in range(EVEN_SHAPES):
            even = repulsion(outcomes, seed + number)
            yield replace(even, directions=rng.permutation(even.directions))
    descending = np.argsort(-target, kind="stable")
    place = np.argsort(descending, kind="stable")
    pool: list[tuple[float, Start]] = []
    for turn in count():
        for _ in range(int(FIRST_DRAW * DRAW_GROWTH**turn)):
            drawn = _random_shape(outcomes, rng)
            if drawn is not None:
                shape, odds = drawn
                distance = float(((odds - target[descending]) ** 2).sum())
                pool.append((distance, replace(shape, directions=shape.directions[place])))
        pool.sort(key=lambda entry: -entry[0])
        for _ in range(min(PROPOSED, len(pool))):
            yield pool.pop()[1]


def _random_shape(outcomes: int, rng: np.random.Generator) -> tuple[Start, Floats] | None:
    """A random polyhedron with a number of rests, in order of their probabilities, which follow;
    None where the polyhedron that was drawn has more rests or fewer."""
    normals, distances = _pebble(outcomes, rng) if rng.random() < 0.5 else _bowl(outcomes, rng)
    try:
        points = polyhedron_corners(normals, distances)
        hull = convex_hull(points)
        if classify(hull, hull.centroid).stable.sum() != outcomes:
            return None
        basins = find_basins(hull, hull.centroid)
    except DiceError:
        return None
    rests = basins[0].paths.rests
    if len(basins) > 1 or len(rests) != outcomes:
        return None
    order = np.argsort(-basins[0].areas, kind="stable")
    start = normalised_start(points, hull.normals[rests[order]])
    return start, basins[0].areas[order] / (4.0 * np.pi)


def _pebble(outcomes: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half-spaces facing all ways: normals (m, 3) and distances (m,)."""
    fewest = max(outcomes, FEWEST_FACETS + 1)
    facets = int(rng.integers(fewest, 2 * fewest + 5))
    normals = spread_directions(facets, rng, REPULSION_STEPS)
    distances = np.exp(rng.uniform(0.0, UNEVENNESS) * rng.normal(size=facets))
    if rng.random() < 0.5:
        distances[0] *= np.exp(-rng.uniform(0.0, NEARNESS))
    normals[:, 2] *= np.exp(-rng.uniform(*STRETCH))
    return normals, distances


def _bowl(outcomes: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half-spaces of a bowl under a low roof: walls that lean outward let the body roll onto its
    bottom, which so gets up to two thirds of the odds."""
    roof, walls = outcomes - 1 + int(rng.integers(0, 2)), int(rng.integers(3, 9))
    normals = np.concatenate(
        [
            [[0.0, 0.0, -1.0]],
            _cone(roof, np.radians(rng.uniform(5.0, 40.0)), rng),
            _cone(walls, np.radians(180.0 - rng.uniform(25.0, 75.0)), rng),
        ]
    )
    normals += 0.05 * rng.normal(size=normals.shape)
    distances = np.exp(0.1 * rng.normal(size=len(normals)))
    distances[0] = rng.uniform(0.3, 0.9)
    distances[1 : 1 + roof] *= rng.uniform(0.3, 1.2)
    distances[1 + roof :] *= rng.uniform(0.5, 1.2)
    return normals, distances


def _cone(facets: int, angle: float, rng: np.random.Generator) -> Floats:
    """(facets, 3) unit vectors at an angle to the z axis, rather evenly spread around it."""
    turns = (np.arange(facets) + rng.random() + 0.3 * rng.normal(size=facets)) / facets
    around = np.stack([np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)], axis=1)
    return np.column_stack([np.sin(angle) * around, np.full(facets, np.cos(angle))])
