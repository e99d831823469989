"""Poses drawn as often as a body comes to rest in them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checks import MOST

__all__ = ["SampledPoses", "Seed", "generator_of", "sampled_poses", "turned"]

Seed = int | np.random.Generator | None
"""Chance: a seed, at least 0, a generator to draw from, or None for another result every time."""


class SampledPoses(NamedTuple):
    """Poses of one body that lies about.

    Attributes
    ----------
    transforms: (n, 4, 4) rigid motions that stand the body on the plane z = 0 with the center of
        mass on the z axis, turned about that axis by any angle, all equally probable.
    rests: (n,) which of the body's rests each is, counted from 0, the most probable first.
    """

    transforms: Floats
    rests: Integers


def sampled_poses(probabilities: Floats, transforms: Floats, n: int, rng: Seed) -> SampledPoses:
    """Draw from the poses of transforms (k, 4, 4), which have probabilities (k,); see
    `RestPoses.sample`."""
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 0 <= n <= MOST:
        raise InputError(f"n: expected a whole number from 0 to {MOST}, got {n!r}; ask for others")
    chance = generator_of(rng)
    # Searching the sums in the rests' own order, so that one draw is one number.
    ends = np.cumsum(probabilities)
    rests = np.searchsorted(ends, ends[-1] * chance.random(n), side="right")
    rests = np.minimum(rests, len(ends) - 1).astype(np.int64)
    return SampledPoses(turned(transforms[rests], 2.0 * math.pi * chance.random(n)), rests)


def generator_of(rng: Seed) -> np.random.Generator:
    """The generator that a seed begins. Raises InputError for what is neither."""
    if isinstance(rng, bool) or (isinstance(rng, int | np.integer) and rng < 0):
        raise InputError(f"rng: expected a seed of at least 0, got {rng!r}; choose another")
    if not (rng is None or isinstance(rng, int | np.integer | np.random.Generator)):
        raise InputError(
            f"rng: expected a seed, a numpy.random.Generator or None, got {type(rng).__name__}; "
            "pass numpy.random.default_rng(seed)"
        )
    return np.random.default_rng(rng)


def turned(transforms: Floats, angles: Floats) -> Floats:
    """Motions (n, 4, 4), followed by turns about the z axis by angles (n,) in radians."""
    turns = np.zeros((len(angles), 4, 4))
    cosines, sines = np.cos(angles), np.sin(angles)
    turns[:, 0, 0], turns[:, 0, 1] = cosines, -sines
    turns[:, 1, 0], turns[:, 1, 1] = sines, cosines
    turns[:, 2, 2] = turns[:, 3, 3] = 1.0
    return turns @ transforms
