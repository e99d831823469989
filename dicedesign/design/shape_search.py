"""Starting shapes for any target: random polyhedra, the nearest in odds first, and needles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.half_space_odds import resting_half_spaces, start_with_odds
from dicedesign.design.needles import needle_near
from dicedesign.design.starts import FEWEST_FACETS, Start, repulsion, spread_directions

__all__ = ["shapes_near"]

Floats = NDArray[np.float64]

EVEN_SHAPES: Final = 2
"""Shapes of equal facets that are proposed first, where there are enough outcomes and even odds are
not far from the target."""

DRAWN: Final = 30
"""Polyhedra drawn in each turn."""

PROPOSED: Final = 2
"""How many of all that were drawn are proposed in each turn."""

FAR: Final = 0.3
"""Distance in odds, the root of their summed squared differences, from which on a polyhedron is
proposed only where there is nothing else."""

REPULSION_STEPS: Final = 10
"""Steps that keep random facets from lying too close to each other."""

UNEVENNESS: Final = 0.6
"""Largest standard deviation of the logarithms of facet distances."""

NEARNESS: Final = 1.5
"""A facet in favour is nearer than others by a factor of up to the exponential of this."""

STRETCH: Final = (-1.5, 1.0)
"""Range of the logarithm by which a polyhedron is stretched along one axis."""


def shapes_near(target: Floats, seed: int) -> Iterator[Start]:
    """Starting shapes with one rest for each outcome and no other, without end.

    First come tangential polyhedra of evenly spread facets, one for each outcome, if even odds are
    near the target. Then, in turn, come random polyhedra, some facets of which are no rests, the
    nearest in their sorted probabilities first, with the largest rest for the largest outcome and
    so on; and a needle (`needle_near`), whose odds are near any target.

    target: (k,) wanted probabilities, k at least 2; seed: of everything random.
    """
    outcomes = len(target)
    rng = np.random.default_rng(seed)
    if outcomes >= FEWEST_FACETS and np.linalg.norm(target - 1.0 / outcomes) < FAR:
        for number in range(EVEN_SHAPES):
            even = repulsion(outcomes, seed + number)
            yield replace(even, directions=rng.permutation(even.directions))
    descending = np.argsort(-target, kind="stable")
    place = np.argsort(descending, kind="stable")
    pool: list[tuple[float, Start]] = []
    while True:
        for _ in range(DRAWN):
            drawn = _random_shape(outcomes, rng)
            if drawn is not None:
                shape, odds = drawn
                distance = float(np.linalg.norm(odds - target[descending]))
                pool.append((distance, replace(shape, directions=shape.directions[place])))
        pool.sort(key=lambda entry: -entry[0])
        near = sum(distance < FAR for distance, _ in pool[-PROPOSED:])
        for _ in range(near):
            yield pool.pop()[1]
        needle = needle_near(target, rng)
        if needle is not None:
            yield needle
        elif near == 0 and pool:
            yield pool.pop()[1]


def _random_shape(outcomes: int, rng: np.random.Generator) -> tuple[Start, Floats] | None:
    """A random polyhedron with a number of rests, in order of their probabilities, which follow;
    None where the polyhedron that was drawn has more rests or fewer."""
    normals, distances = _pebble(outcomes, rng) if rng.random() < 0.5 else _bowl(outcomes, rng)
    rests = resting_half_spaces(normals, distances)
    found = start_with_odds(normals, distances, rests) if len(rests) == outcomes else None
    if found is None:
        return None
    start, odds = found
    order = np.argsort(-odds, kind="stable")
    return replace(start, directions=start.directions[order]), odds[order]


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
