"""Total variation between probabilities and throws, with its sampling error.

Frequencies of few throws differ from the probabilities of the die, and total variation adds up all
deviations. So it is not 0 even for a perfect die: its mean is the noise floor, with which every
total variation must be compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincinv, betaln, ndtri, xlog1py, xlogy

from dicedesign.runtime.arrays import Floats, Integers


def jeffreys_means(counts: ArrayLike) -> Floats:
    """Posterior means (k,) of probabilities under Jeffreys' prior (all Dirichlet parameters 1/2).

    They are above 0 and sum to 1.

    Source: Jeffreys, Proc. R. Soc. A 186, 1946.
    """
    weights: Floats = np.asarray(counts, dtype=np.float64) + 0.5
    return weights / weights.sum()


def jeffreys_intervals(counts: ArrayLike, confidence: float) -> Floats:
    """(k, 2) equal-tailed credible intervals of probabilities under Jeffreys' prior.

    counts: (k,) at least 0. confidence: posterior probability of each interval, in (0, 1).
    """
    weights = np.asarray(counts, dtype=np.float64) + 0.5
    others = weights.sum() - weights
    # The upper limit also by its small tail: 1 less a tiny tail rounds to 1.
    tail = (1.0 - confidence) / 2.0
    limits = [betaincinv(weights, others, tail), 1.0 - betaincinv(others, weights, tail)]
    return np.stack(limits, axis=-1)


MAX_COUNTS = 1_000_000
"""Counts drawn at a time, at most, unless one series has more."""


def draw_counts(probabilities: Floats, throws: int, series: int, seed: int) -> Iterator[Integers]:
    """Yield blocks (b, k) of random counts, `series` rows in all, from probabilities (k,).

    The size of a block does not change the counts.
    """
    random, at_once = np.random.default_rng(seed), max(1, MAX_COUNTS // len(probabilities))
    for first in range(0, series, at_once):
        yield random.multinomial(throws, probabilities, size=min(at_once, series - first))


DRAWS = 10_000

SEED = 0


@dataclass(frozen=True)
class MeasuredVariation:
    """Total variation between given probabilities and the unknown ones of a die, from throws.

    Attributes
    ----------
    value: between the given probabilities and the frequencies, 0 to 1.
    interval: confidence interval of the total variation of the unknown probabilities.
    noise_floor: mean of `value` for a die that has the given probabilities.
    """

    value: float
    interval: tuple[float, float]
    noise_floor: float


def total_variation(first: ArrayLike, second: ArrayLike) -> float:
    """Half the sum of absolute differences of two distributions (k,), 0 to 1: the largest
    difference in the probability of any event."""
    return float(np.abs(np.asarray(first) - np.asarray(second)).sum() / 2.0)


def noise_floor(probabilities: ArrayLike, throws: float) -> float:
    """Mean total variation between the probabilities (k,) of a die and its frequencies.

    throws: at least 1; rounded down to a whole number.

    Source: the mean absolute deviation of a binomial distribution by De Moivre, 1730; Diaconis and
    Zabell, Statistical Science 6(3), 1991, eq. 1.1.
    """
    p = np.asarray(probabilities, dtype=np.float64)
    n = math.floor(throws)
    above = np.floor(n * p) + 1.0
    below = n - above + 1.0
    halves = np.exp(xlogy(above, p) + xlog1py(below, -p) - betaln(above, below))
    return float(halves.sum() / n)


def event_error(probabilities: Floats, throws: float, confidence: float) -> float:
    """Largest sampling error of an event's frequency, with `confidence` in (0, 1).

    By the normal limit z sqrt(m (1 - m) / n), where m is the largest of the probabilities (k,), but
    at least 1/2.
    """
    most = max(0.5, float(probabilities.max()))
    return -float(ndtri((1.0 - confidence) / 2.0)) * math.sqrt(most * (1.0 - most) / throws)


def measure_variation(
    counts: ArrayLike, probabilities: ArrayLike, confidence: float
) -> MeasuredVariation:
    """Total variation between given probabilities and the unknown ones of a thrown die, with its
    uncertainty.

    The interval holds for any probabilities, also the given ones, where neither the bootstrap nor
    the delta method does:

    - By the triangle inequality, total variation is wrong by at most the distance between the
      frequencies and the die's probabilities. The lower limit subtracts a quantile of that
      distance, from `DRAWS` series of throws drawn with a fixed seed.
    - Total variation is the largest difference in the probability of an event, and the frequencies
      show at least the difference in the event that differs most. The upper limit adds the
      sampling error of one event, `event_error`.

    Both take the die's probabilities as `jeffreys_means`. The lower limit is conservative if many
    labels deviate a little.

    Parameters
    ----------
    counts: (k,) at least 0, with a sum of at least 1.
    probabilities: (k,) summing to 1.
    confidence: in (0, 1).
    """
    came = np.asarray(counts, dtype=np.float64)
    throws = float(came.sum())
    value = total_variation(came / throws, probabilities)
    estimate = jeffreys_means(came)
    distances = [
        np.abs(drawn / math.floor(throws) - estimate).sum(axis=1) / 2.0
        for drawn in draw_counts(estimate, math.floor(throws), DRAWS, SEED)
    ]
    scatter = float(np.quantile(np.concatenate(distances), (1.0 + confidence) / 2.0))
    error = event_error(estimate, throws, confidence)
    limits = max(0.0, value - scatter), min(1.0, value + error)
    return MeasuredVariation(value, limits, noise_floor(probabilities, throws))
