"""Searches for starting shapes: random polyhedra with probabilities near any target, needles
between them, and variations of a given shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from typing import Final

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.coordinates import coordinates_of
from dicedesign.optimize.starts.needles import needle_near
from dicedesign.optimize.starts.shapes import repulsion, spread_directions, start_with_probabilities
from dicedesign.optimize.starts.start import FEWEST_FACETS, Start
from dicedesign.runtime.arrays import Floats


def shapes_near(target: Floats, seed: int, helpers: int = 0) -> Iterator[Start | None]:
    """Yield starting shapes with one rest for each outcome and no other, without end; None for a
    turn without a shape.

    If equal probabilities are near the target, tangential polyhedra of evenly spread facets come
    first. Then random polyhedra, some facets of which are no rests, come in order of the distance
    of their sorted probabilities from the target, with the most probable rest for the most probable
    outcome and so on. Between them come needles (`needle_near`), whose probabilities are near any
    target.

    target: (k,) probabilities, k at least 2; seed: random seed; helpers: least number of facets
    without an outcome.
    """
    outcomes = len(target)
    rng = np.random.default_rng(seed)
    place = np.argsort(np.argsort(-target, kind="stable"), kind="stable")

    def even(number: int) -> Start | None:
        if outcomes < FEWEST_FACETS:
            return None
        shape = repulsion(outcomes, seed + number)
        return replace(shape, directions=rng.permutation(shape.directions))

    def draw() -> tuple[Start, Floats] | None:
        pebble = rng.random() < 0.5
        normals, distances = _pebble(outcomes + helpers, rng) if pebble else _bowl(outcomes, rng)
        candidate = start_with_probabilities(normals, distances, outcomes)
        if candidate is None:
            return None
        start, probabilities, _ = candidate
        order = np.argsort(-probabilities, kind="stable")[place]
        return replace(start, directions=start.directions[order]), probabilities[order]

    return nearest_first(target, helpers, even, draw, lambda: needle_near(target, rng))


def _pebble(outcomes: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half-spaces in all directions: normals (m, 3) and distances (m,)."""
    fewest = max(outcomes, FEWEST_FACETS + 1)
    facets = int(rng.integers(fewest, 2 * fewest + 5))
    normals = spread_directions(facets, rng, REPULSION_STEPS)
    distances = np.exp(rng.uniform(0.0, UNEVENNESS) * rng.normal(size=facets))
    if rng.random() < 0.5:
        distances[0] *= np.exp(-rng.uniform(0.0, NEARNESS))
    normals[:, 2] *= np.exp(-rng.uniform(*STRETCH))
    return normals, distances


def _bowl(outcomes: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half-spaces of a bowl under a low roof: normals (m, 3) and distances (m,). As its walls lean
    outward, the body rolls onto its bottom with a probability of up to two thirds."""
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
    """Unit vectors (facets, 3) at an angle to the z axis, spread around it."""
    turns = (np.arange(facets) + rng.random() + 0.3 * rng.normal(size=facets)) / facets
    around = np.stack([np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)], axis=1)
    return np.column_stack([np.sin(angle) * around, np.full(facets, np.cos(angle))])


EVEN_SHAPES: Final = 2
"""Shapes of evenly spread facets that come first if equal probabilities are near the target."""

FAR: Final = 0.3
"""Distance of probabilities, the root of their summed squared differences, above which a polyhedron
is proposed only if there is nothing else."""

DRAWN: Final = 30
"""Limit on the polyhedra drawn in each turn."""

DRAWN_OUTCOMES: Final = 2000
"""Limit on the outcomes of all polyhedra of a turn, unless it is one."""

PROPOSED: Final = 2
"""Limit on the polyhedra proposed in each turn."""

REPULSION_STEPS: Final = 10
"""Steps of repulsion between random facets."""

UNEVENNESS: Final = 0.6
"""Limit on the standard deviation of the logarithms of facet distances."""

NEARNESS: Final = 1.5
"""Limit on the logarithm of the factor by which a preferred facet is nearer."""

STRETCH: Final = (-1.5, 1.0)
"""Range of the logarithm by which a polyhedron is stretched along one axis."""


def nearest_first(
    target: Floats,
    helpers: int,
    even: Callable[[int], Start | None],
    draw: Callable[[], tuple[Start, Floats] | None],
    another: Callable[[], Start | None] = lambda: None,
) -> Iterator[Start | None]:
    """Yield starting shapes without end, and None for a turn without a shape.

    Even shapes come first, each in a turn of its own, if equal probabilities are near the target.
    Each later turn adds random polyhedra to a pool. It proposes the nearest of the pool if they are
    near, then another shape, and the nearest of the pool if there was neither.

    target: (k,) probabilities; helpers: least number of facets without an outcome, which even
    shapes do not have; even: makes even shape number n from 0; draw: makes a random polyhedron and
    its probabilities (k,), or None; another: makes the other shape, or None.
    """

    def suits(start: Start) -> bool:
        least = outcomes + helpers
        return helpers == 0 or len(convex_hull(start.points).normals) >= least

    outcomes = len(target)
    if np.linalg.norm(target - 1.0 / outcomes) < FAR:
        for number in range(EVEN_SHAPES):
            yield even(number) if helpers == 0 else None
    pool: list[tuple[float, Start]] = []
    while True:
        for _ in range(max(min(DRAWN, DRAWN_OUTCOMES // outcomes), 1)):
            if (drawn := draw()) is not None and suits(drawn[0]):
                pool.append((float(np.linalg.norm(drawn[1] - target)), drawn[0]))
        pool.sort(key=lambda entry: -entry[0])
        near = sum(distance < FAR for distance, _ in pool[-PROPOSED:])
        for _ in range(near):
            yield pool.pop()[1]
        if (other := another()) is not None and suits(other):
            yield other
        elif near == 0:
            yield pool.pop()[1] if pool else None


FIRST_VARIATION: Final = 0.01
"""Size of the first variation of a start: the standard deviation of normals and of logarithms of
distances."""

LARGEST_VARIATION: Final = 0.3
"""Limit of the size of variations."""


def shapes_like(start: Start, seed: int, group: Floats | None = None) -> Iterator[Start]:
    """Yield a start, then variations with facets turned and shifted more and more, without end.
    Pinned facets stay. Variations that are no solids are skipped.

    Parameters
    ----------
    start: the shape.
    seed: random seed of the variations.
    group: (g, 3, 3) point group about the origin, the symmetry of the start and its variations, or
        None.

    Raises
    ------
    InputError: the start does not have the symmetry.
    """
    yield start
    hull = convex_hull(start.points)
    pinned = start.directions[list(start.pinned)]
    coordinates, parameters = coordinates_of(start.points, hull.centroid, group, pinned)
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
        yield replace(start, points=points, directions=normals[nearest])
