"""Distances of two predictions of the same body's rests, beside what chance alone makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.runtime.arrays import Floats
from dicedesign.throws.distances import total_variation, wasserstein_distance


@dataclass(frozen=True)
class Prediction:
    """Odds of a body's rests.

    Attributes
    ----------
    odds: (k,) summing to 1.
    drops: that they were counted in, at least 1, whole; None for exact odds.
    """

    odds: Floats
    drops: int | None = None

    def drawn(self, odds: Floats, rng: np.random.Generator) -> Floats:
        """Frequencies (k,) of as many drops of a body with some odds (k,)."""
        if self.drops is None:
            return odds
        frequencies: Floats = rng.multinomial(self.drops, odds) / self.drops
        return frequencies


@dataclass(frozen=True)
class Distance:
    """A distance between two predictions.

    Attributes
    ----------
    value: between the odds as they were counted.
    error: standard error, from drops drawn again out of those that there are.
    noise_floor: mean distance of two predictions that are both right, at these numbers of drops.
    """

    value: float
    error: float
    noise_floor: float


@dataclass(frozen=True)
class OddsComparison:
    """Wasserstein distance on the sphere in radians, and total variation, 0 to 1."""

    wasserstein: Distance
    total_variation: Distance


def compare_odds(
    normals: Floats,
    first: Prediction,
    second: Prediction,
    draws: int,
    rng: np.random.Generator,
) -> OddsComparison:
    """The distances between two predictions, with their sampling error and noise floor.

    Drops are taken as independent. Where their initial directions are spread evenly they scatter
    less than that, so that error and noise floor are cautious.

    Parameters
    ----------
    normals: (k, 3) of the rests.
    draws: how often drops are drawn anew, at least 2: for the error from the frequencies of each
        prediction, for the noise floor from the odds that are exact, or from those of both
        predictions together.
    """

    def distances(one: Floats, other: Floats) -> tuple[float, float]:
        return (
            wasserstein_distance(normals, one, normals, other),
            total_variation(one, other),
        )

    both = (first, second)
    right = _common_odds(first, second)
    values = distances(first.odds, second.odds)
    again = [distances(*(p.drawn(p.odds, rng) for p in both)) for _ in range(draws)]
    equal = [distances(*(p.drawn(right, rng) for p in both)) for _ in range(draws)]
    errors, floors = np.std(again, axis=0, ddof=1), np.mean(equal, axis=0)
    return OddsComparison(
        *(Distance(v, float(e), float(f)) for v, e, f in zip(values, errors, floors, strict=True))
    )


def _common_odds(first: Prediction, second: Prediction) -> Floats:
    """Odds (k,) by both predictions together."""
    if first.drops is None or second.drops is None:
        return (first if first.drops is None else second).odds
    summed = first.drops * first.odds + second.drops * second.odds
    odds: Floats = summed / summed.sum()
    return odds
