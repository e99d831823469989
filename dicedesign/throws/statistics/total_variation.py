"""Total variation between odds and what was thrown, with its sampling error.

Frequencies of few throws are never the odds of the die, and total variation adds up the deviations
whatever their signs. So that of a perfect die is not 0: its mean is the noise floor, beside which
every total variation has to be read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.runtime.arrays import Floats
from dicedesign.throws.statistics.intervals import jeffreys_means
from dicedesign.throws.statistics.multinomial_draws import drawn_counts

__all__ = [
    "MeasuredDistance",
    "effective_counts",
    "measure_variation",
    "noise_floor",
    "total_variation",
]

DRAWS: Final = 10_000

SEED: Final = 0


@dataclass(frozen=True)
class MeasuredDistance:
    """A distance between given odds and the unknown odds of a die that was thrown.

    Attributes
    ----------
    value: between the given odds and the frequencies; of a total variation 0 to 1, of a Wasserstein
        distance in radians, 0 to pi.
    interval: holds that of the unknown odds with the asked-for confidence.
    noise_floor: mean of `value` if the given odds were those of the die.
    """

    value: float
    interval: tuple[float, float]
    noise_floor: float


def total_variation(first: ArrayLike, second: ArrayLike) -> float:
    """Half the sum of the absolute differences of two distributions (k,), 0 to 1: the largest
    difference that they make to the probability of any event."""
    return float(np.abs(np.asarray(first) - np.asarray(second)).sum() / 2.0)


def effective_counts(outcomes: ArrayLike, weights: ArrayLike, kinds: int) -> Floats:
    """Counts (k,) that stand for throws of unequal weight, as of directions that stand for cells of
    the sphere of unequal area.

    They have the proportions of the weighted frequencies, and sum to the number of throws of equal
    weight with the same variance, the squared sum of the weights over the sum of their squares.
    Weighted throws whose initial directions are spread evenly scatter less than that says.

    Parameters
    ----------
    outcomes: (n,) what each throw showed, 0 to k - 1.
    weights: (n,) positive.
    kinds: k.

    Source: Kish, Survey Sampling, 1965, section 11.7.
    """
    given = np.asarray(weights, dtype=np.float64)
    sums = np.bincount(np.asarray(outcomes), given, kinds)
    return np.asarray(sums * given.sum() / (given * given).sum())


def noise_floor(odds: ArrayLike, throws: float) -> float:
    """The mean total variation between the odds (k,) of a die and its frequencies in at least one
    throw; of fractions of a throw, only whole ones count.

    Source: the mean absolute deviation of a binomial distribution by De Moivre, 1730; Diaconis and
    Zabell, Statistical Science 6(3), 1991, eq. 1.1.
    """
    from scipy.special import betaln, xlog1py, xlogy

    p = np.asarray(odds, dtype=np.float64)
    n = math.floor(throws)
    above = np.floor(n * p) + 1.0
    below = n - above + 1.0
    halves = np.exp(xlogy(above, p) + xlog1py(below, -p) - betaln(above, below))
    return float(halves.sum() / n)


def measure_variation(counts: ArrayLike, odds: ArrayLike, confidence: float) -> MeasuredDistance:
    """The total variation between given odds and those of a die that was thrown.

    The interval holds for any odds, also for those equal to the given ones, where neither the
    bootstrap nor the delta method does:

    - As a metric, total variation differs by no more than the frequencies are from the odds of the
      die. The lower limit is less by the quantile of that, of `DRAWS` series of throws drawn with
      a fixed seed.
    - It is the largest difference in the probability of an event, so that the frequencies show at
      least what they show in the event that differs most for the die. The upper limit is more by
      what chance allows in one event, by the normal limit: z sqrt(m (1 - m) / n), where m is the
      probability of the most probable outcome, but at least 1/2.

    The odds of the die are taken there as `jeffreys_means`. Where many labels
    deviate a little the lower limit is a cautious one.

    Parameters
    ----------
    counts: (k,) at least 0, those of `effective_counts` too, with a sum of at least 1.
    odds: (k,) summing to 1.
    confidence: in (0, 1).
    """
    from scipy.special import ndtri

    came = np.asarray(counts, dtype=np.float64)
    throws = float(came.sum())
    value = total_variation(came / throws, odds)
    estimate = jeffreys_means(came)
    most = max(0.5, float(estimate.max()))
    chance = -float(ndtri((1.0 - confidence) / 2.0)) * math.sqrt(most * (1.0 - most) / throws)
    scatter = _scatter(estimate, math.floor(throws), (1.0 + confidence) / 2.0)
    limits = (max(0.0, value - scatter), min(1.0, value + chance))
    return MeasuredDistance(value, limits, noise_floor(odds, throws))


def _scatter(odds: Floats, throws: int, level: float) -> float:
    """Quantile of the total variation between odds (k,) and frequencies."""
    distances = [
        np.abs(counts / throws - odds).sum(axis=1) / 2.0
        for counts in drawn_counts(odds, throws, DRAWS, SEED)
    ]
    return float(np.quantile(np.concatenate(distances), level))
