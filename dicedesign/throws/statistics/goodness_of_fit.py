"""Tests of counts against given odds, and against other counts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, gammaln, xlogy

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.statistics.multinomial_draws import drawn_counts
from dicedesign.tolerances import EQUAL_LIKELIHOOD

__all__ = [
    "ChiSquareTest",
    "MultinomialTest",
    "chi_square",
    "exact_multinomial",
    "two_sample_chi_square",
]

MOST_TABLES: Final = 1_000_000
"""Tables of counts that are listed; where there are more, `DRAWS` are drawn at random."""

DRAWS: Final = 100_000

SEED: Final = 0


@dataclass(frozen=True)
class ChiSquareTest:
    """Pearson's test.

    Attributes
    ----------
    statistic: at least 0; infinite if something came up that cannot.
    degrees: of freedom.
    p_value: probability of a statistic no smaller, for many throws of a die as supposed; 1 without
        a degree of freedom.
    """

    statistic: float
    degrees: int
    p_value: float


@dataclass(frozen=True)
class MultinomialTest:
    """The exact test.

    Attributes
    ----------
    p_value: probability of counts that are no more probable than those observed.
    tables: possible counts of so many throws that were looked at.
    standard_error: of the p-value; 0 where all possible counts were looked at.
    """

    p_value: float
    tables: int
    standard_error: float


def chi_square(counts: ArrayLike, odds: ArrayLike) -> ChiSquareTest:
    """Pearson's test of whether counts (k,), not all 0, come from odds (k,) that sum to 1.

    Outcomes without odds that did not come up are left out.

    Source: Pearson, Philosophical Magazine 50, 1900.
    """
    came, p = np.asarray(counts, dtype=np.float64), np.asarray(odds, dtype=np.float64)
    possible = p > 0.0
    if came[~possible].any():
        return ChiSquareTest(math.inf, int(possible.sum()), 0.0)
    expected = came.sum() * p[possible]
    statistic = float((np.square(came[possible] - expected) / expected).sum())
    return _judged(statistic, int(possible.sum()) - 1)


def two_sample_chi_square(first: ArrayLike, second: ArrayLike) -> ChiSquareTest:
    """Pearson's test of whether two sets of counts (k,), neither all 0, come from the same odds,
    whatever these are. Outcomes that never came up are left out."""
    both = np.stack([np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)])
    both = both[:, both.any(axis=0)]
    expected = both.sum(axis=1, keepdims=True) * both.sum(axis=0) / both.sum()
    return _judged(float((np.square(both - expected) / expected).sum()), both.shape[1] - 1)


def _judged(statistic: float, degrees: int) -> ChiSquareTest:
    p_value = float(chdtrc(degrees, statistic)) if degrees else 1.0
    return ChiSquareTest(statistic, degrees, p_value)


def exact_multinomial(counts: ArrayLike, odds: ArrayLike) -> MultinomialTest:
    """The exact test of whether counts come from given odds; unlike Pearson's it holds for few
    throws and rare outcomes too.

    All possible counts are listed, or, where they are more than `MOST_TABLES`, 100 000 are drawn
    at random with a fixed seed. Those observed count as one more of them, so that no p-value is 0.

    Parameters
    ----------
    counts: (k,) whole numbers of at least 0, not all 0.
    odds: (k,) positive, summing to 1.
    """
    came, p = np.asarray(counts, dtype=np.int64), np.asarray(odds, dtype=np.float64)
    throws, kinds = int(came.sum()), len(p)
    observed = _log_likelihood(came, p)
    # Each term but the first is taken off.
    terms = 2.0 * gammaln(throws + 1.0) - observed
    observed = observed + EQUAL_LIKELIHOOD * terms
    tables = math.comb(throws + kinds - 1, kinds - 1)
    if tables <= MOST_TABLES:
        every = _all_log_likelihoods(throws, p)
        return MultinomialTest(min(1.0, float(np.exp(every[every <= observed]).sum())), tables, 0.0)
    hits = 1
    for drawn in drawn_counts(p, throws, DRAWS, SEED):
        hits += int((_log_likelihood(drawn, p) <= observed).sum())
    looked_at = 1 + DRAWS
    p_value = hits / looked_at
    return MultinomialTest(p_value, looked_at, math.sqrt(p_value * (1.0 - p_value) / looked_at))


def _log_likelihood(counts: Integers, odds: Floats) -> Floats:
    """Logarithms (...) of the probabilities of counts (..., k)."""
    of_orders = gammaln(counts.sum(-1) + 1.0) - gammaln(counts + 1.0).sum(-1)
    return np.asarray(of_orders + xlogy(counts, odds).sum(-1))


def _all_log_likelihoods(throws: int, odds: Floats) -> Floats:
    """Logarithms of the probabilities of all possible counts."""
    left = np.array([throws])
    likelihood = np.array([gammaln(throws + 1.0)])
    for p in odds[:-1]:
        # Each table so far goes on with 0, 1, ... of what it has left.
        ways = left + 1
        starts = np.repeat(np.cumsum(ways) - ways, ways)
        count = np.arange(ways.sum()) - starts
        left = np.repeat(left, ways) - count
        likelihood = np.repeat(likelihood, ways) + count * math.log(p) - gammaln(count + 1.0)
    return np.asarray(likelihood + left * math.log(odds[-1]) - gammaln(left + 1.0))
