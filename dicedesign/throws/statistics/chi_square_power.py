"""Chance that Pearson's test of so many rolls notices dice whose odds are a little off."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.special import chdtr, chdtri, chndtr

from dicedesign.runtime.arrays import Floats

__all__ = ["chance_noticed", "chances_noticed", "weighted_chi_square_tail"]

LEVEL: Final = 0.05
"""Of the test: it finds fault with so many dice that are right."""

LAST_TERM: Final = 1e-12
"""Terms of the series below are left out."""

CERTAIN: Final = 600.0
"""Half the sum of the noncentralities from which on the series' first term is no number, and the
test cannot but notice."""


def chance_noticed(target: Floats, rolls: int, covariance: Floats, bias: Floats) -> float:
    """Chance that a test at the level `LEVEL` of rolls of a die drawn at random says that its odds
    are not the target's.

    The odds of such a die are normal; given these, counts of many rolls are normal too. So
    Pearson's statistic, over both, is a weighted sum of squares of normal numbers.

    Parameters
    ----------
    target: (k,) positive, summing to 1. One outcome alone is never off.
    rolls: of the one die; each outcome is expected five times or more.
    covariance: (k, k) of the odds among dice.
    bias: (k,) mean of the odds less the target.
    """
    if len(target) == 1:
        return 0.0
    root = np.sqrt(target)
    # Orthonormal directions in which frequencies can vary: all that are normal to `root`.
    free = np.linalg.svd(root[None])[2][1:]
    spread = rolls * free @ (covariance / np.outer(root, root)) @ free.T
    values, vectors = np.linalg.eigh(spread)
    weights = 1.0 + np.maximum(values, 0.0)
    means = vectors.T @ free @ (bias / root) * math.sqrt(rolls)
    critical = float(chdtri(len(target) - 1, LEVEL))
    return weighted_chi_square_tail(critical, weights, means**2 / weights)


def chances_noticed(target: Floats, rolls: int, biases: Floats) -> Floats:
    """(n,) the same of dice that are known, by their odds less the target's (n, k)."""
    if len(target) == 1:
        return np.zeros(len(biases))
    shares = (biases**2 / target).sum(axis=1) - biases.sum(axis=1) ** 2
    critical = float(chdtri(len(target) - 1, LEVEL))
    below = chndtr(critical, len(target) - 1, rolls * np.maximum(shares, 0.0))
    return np.asarray(1.0 - below)


def weighted_chi_square_tail(value: float, weights: Floats, noncentralities: Floats) -> float:
    """Probability that `sum(weights * x)` is above a value, for independent x that are chi-square
    of one degree of freedom and of noncentralities (r,); weights: (r,) positive.

    Source: Ruben, Annals of Mathematical Statistics 33, 1962, as a series of central chi-squares
    with the smallest weight as their scale.
    """
    if noncentralities.sum() / 2.0 > CERTAIN:
        return 1.0
    least = weights.min()
    gaps = 1.0 - least / weights
    first = math.exp(-noncentralities.sum() / 2.0) * float(np.sqrt(least / weights).prod())
    series, slopes = [first], []
    degrees, scaled = len(weights), value / least
    below = first * float(chdtr(degrees, scaled))
    powers = np.ones_like(gaps)
    while (left := float(chdtr(degrees + 2 * len(series), scaled))) > LAST_TERM:
        order = len(series)
        noncentral = order * noncentralities * powers * (1.0 - gaps)
        powers = powers * gaps
        slopes.append(float((powers + noncentral).sum()) / 2.0)
        series.append(float(np.dot(slopes[::-1], series)) / order)
        below += series[-1] * left
    return min(max(1.0 - below, 0.0), 1.0)
