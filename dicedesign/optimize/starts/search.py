"""Starting shapes for any target, in turns: random polyhedra are drawn into a pool, the nearest in
probabilities go first, and between them needles; and variations of a shape that is given."""

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
    """Starting shapes with one rest for each outcome and no other, without end; None where a turn
    found nothing, so that whoever asks can stop.

    First come tangential polyhedra of evenly spread facets, one for each outcome, if equal
    probabilities are near the target. Then, in turn, come random polyhedra, some facets of which
    are no rests, the nearest in their sorted probabilities first, with the largest rest for the
    largest outcome and so on; and a needle (`needle_near`), whose probabilities are near any
    target.

    target: (k,) wanted probabilities, k at least 2; seed: of everything random; helpers: least
        number of facets without an outcome.
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
    bottom, which so gets up to two thirds of the probabilities."""
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


EVEN_SHAPES: Final = 2
"""Shapes of evenly spread facets that are proposed first, where equal probabilities are not far
from the target."""

FAR: Final = 0.3
"""Distance in probabilities, the root of their summed squared differences, from which on a
polyhedron is proposed only where there is nothing else."""

DRAWN: Final = 30
"""Most polyhedra drawn in each turn."""

DRAWN_OUTCOMES: Final = 2000
"""Most outcomes of all of them together, unless it is one polyhedron."""

PROPOSED: Final = 2
"""How many of all that were drawn are proposed in each turn."""

REPULSION_STEPS: Final = 10
"""Steps that keep random facets from lying too close to each other."""

UNEVENNESS: Final = 0.6
"""Largest standard deviation of the logarithms of facet distances."""

NEARNESS: Final = 1.5
"""A facet in favor is nearer than others by a factor of up to the exponential of this."""

STRETCH: Final = (-1.5, 1.0)
"""Range of the logarithm by which a polyhedron is stretched along one axis."""


def nearest_first(
    target: Floats,
    helpers: int,
    even: Callable[[int], Start | None],
    draw: Callable[[], tuple[Start, Floats] | None],
    another: Callable[[], Start | None] = lambda: None,
) -> Iterator[Start | None]:
    """Starting shapes without end, and None where a turn found nothing, so that whoever asks can
    stop.

    First come even shapes, each a turn of its own, if equal probabilities are near the target. Each
    later turn draws polyhedra into a pool. It proposes the nearest in probabilities of all in the
    pool, if they are near, then another shape, and the nearest of those far away if there was
    neither.

    target: (k,) wanted probabilities; helpers: least number of facets without an outcome, of which
    even shapes have none; even: makes the shape of a number from 0; draw: makes a
    random polyhedron and its probabilities (k,), or None where what was drawn does not suit;
    another: makes a shape that is proposed in each turn, if not None.
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
"""Size of the first variation of a start: a standard deviation of normals, and of the logarithms of
distances."""

LARGEST_VARIATION: Final = 0.3
"""Size that variations approach."""


def shapes_like(start: Start, seed: int, group: Floats | None = None) -> Iterator[Start]:
    """Yield a start, then variants with facets turned and shifted more and more, without end;
    pinned facets stay.

    Where that leaves no solid, the next one follows.

    Parameters
    ----------
    start: the shape.
    seed: of the variations.
    group: (g, 3, 3) a point group about the origin that the start has as symmetry, and that its
        variations are to keep, or None.

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
