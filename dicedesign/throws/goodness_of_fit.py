"""Tests of counts against given probabilities and against other counts, their power, and the
verdict of a die's throws on its probabilities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtr, chdtrc, chdtri, chndtr, chndtrinc, gammaln, xlogy

from dicedesign.runtime.arrays import Floats, Integers, exact_intervals
from dicedesign.throws.distances import (
    MeasuredDistance,
    Posterior,
    draw_counts,
    event_error,
    jeffreys_posterior,
    measure_variation,
)
from dicedesign.tolerances import EQUAL_LIKELIHOOD, EQUAL_PROBABILITIES

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
    tables: number of possible counts that were enumerated.
    standard_error: of the p-value; 0 where all possible counts were looked at.
    """

    p_value: float
    tables: int
    standard_error: float


def chi_square(counts: ArrayLike, probabilities: ArrayLike) -> ChiSquareTest:
    """Pearson's test of whether counts (k,), not all 0, come from probabilities (k,) that sum to 1.

    Outcomes without probabilities that did not come up are left out.

    Source: Pearson, Philosophical Magazine 50, 1900.
    """
    came, p = np.asarray(counts, dtype=np.float64), np.asarray(probabilities, dtype=np.float64)
    possible = p > 0.0
    if came[~possible].any():
        return ChiSquareTest(math.inf, int(possible.sum()), 0.0)
    expected = came.sum() * p[possible]
    statistic = float((np.square(came[possible] - expected) / expected).sum())
    return _judge(statistic, int(possible.sum()) - 1)


def two_sample_chi_square(first: ArrayLike, second: ArrayLike) -> ChiSquareTest:
    """Pearson's test of whether two sets of counts (k,), neither all 0, come from equal
    probabilities. Outcomes that never came up are skipped."""
    both = np.stack([np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)])
    both = both[:, both.any(axis=0)]
    expected = both.sum(axis=1, keepdims=True) * both.sum(axis=0) / both.sum()
    return _judge(float((np.square(both - expected) / expected).sum()), both.shape[1] - 1)


def _judge(statistic: float, degrees: int) -> ChiSquareTest:
    p_value = float(chdtrc(degrees, statistic)) if degrees else 1.0
    return ChiSquareTest(statistic, degrees, p_value)


def exact_multinomial(counts: ArrayLike, probabilities: ArrayLike) -> MultinomialTest:
    """The exact test of whether counts come from given probabilities; unlike Pearson's it holds for
    few throws and rare outcomes too.

    All possible counts are listed, or, where they are more than `MOST_TABLES`, 100 000 are drawn
    at random with a fixed seed. Those observed count as one more of them, so that no p-value is 0.

    Parameters
    ----------
    counts: (k,) whole numbers of at least 0, not all 0.
    probabilities: (k,) positive, summing to 1.
    """
    came, p = np.asarray(counts, dtype=np.int64), np.asarray(probabilities, dtype=np.float64)
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
    for drawn in draw_counts(p, throws, DRAWS, SEED):
        hits += int((_log_likelihood(drawn, p) <= observed).sum())
    looked_at = 1 + DRAWS
    p_value = hits / looked_at
    return MultinomialTest(p_value, looked_at, math.sqrt(p_value * (1.0 - p_value) / looked_at))


def _log_likelihood(counts: Integers, probabilities: Floats) -> Floats:
    """Logarithms (...) of the probabilities of counts (..., k)."""
    of_orders = gammaln(counts.sum(-1) + 1.0) - gammaln(counts + 1.0).sum(-1)
    return np.asarray(of_orders + xlogy(counts, probabilities).sum(-1))


def _all_log_likelihoods(throws: int, probabilities: Floats) -> Floats:
    """Logarithms of the probabilities of all possible counts."""
    left = np.array([throws])
    likelihood = np.array([gammaln(throws + 1.0)])
    for p in probabilities[:-1]:
        # Each table so far goes on with 0, 1, ... of what it has left.
        ways = left + 1
        starts = np.repeat(np.cumsum(ways) - ways, ways)
        count = np.arange(ways.sum()) - starts
        left = np.repeat(left, ways) - count
        likelihood = np.repeat(likelihood, ways) + count * math.log(p) - gammaln(count + 1.0)
    return np.asarray(likelihood + left * math.log(probabilities[-1]) - gammaln(left + 1.0))


LEVEL: Final = 0.05
"""Level of the test: the share of right dice that it rejects."""

LAST_TERM: Final = 1e-12
"""Terms of the series below are left out."""

CERTAIN: Final = 600.0
"""Half the sum of the noncentralities from which on the series' first term is no number, and the
test cannot but notice."""


def chance_noticed(target: Floats, rolls: int, covariance: Floats, bias: Floats) -> float:
    """Chance that a test at the level `LEVEL` of rolls of a die drawn at random says that its
    probabilities are not the target's.

    The probabilities of such a die are normal; given these, counts of many rolls are normal too. So
    Pearson's statistic, over both, is a weighted sum of squares of normal numbers.

    Parameters
    ----------
    target: (k,) positive, summing to 1. One outcome alone is never off.
    rolls: of the one die; each outcome is expected five times or more.
    covariance: (k, k) of the probabilities among dice.
    bias: (k,) mean of the probabilities less the target.
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
    """(n,) probabilities that the test rejects dice, given by their probabilities less the
    target's (n, k)."""
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


FEWEST_EXPECTED: Final = 5.0
"""Of an outcome that is expected less often the statistic of Pearson's test is not distributed as
it supposes: Cochran, Biometrics 10(4), 1954."""

POWER: Final = 0.8
"""Probability with which a wrong die is to be found out."""

WITHIN: Final = 0.02
"""Total variation up to which a die counts as right."""


@dataclass(frozen=True)
class RollVerdict:
    """The verdict of counts of k outcomes on given probabilities.

    Attributes
    ----------
    counts, probabilities: (k,) what came up, and what was to come up.
    confidence: of all intervals; 1 less is the level of the test.
    intervals: (k, 2) exact limits of each probability.
    posterior: posterior of the probabilities, by the prior of Jeffreys.
    chi_square: Pearson's test of the probabilities.
    exact: the exact test, where an outcome is expected fewer than 5 times.
    variation: total variation of the die's probabilities from the given ones.
    to_reject: throws, those made among them, after which a die whose probabilities are the
        frequencies seen is rejected with probability `POWER`; None if these are the given
        probabilities. Frequencies deviate by chance, too: of a perfect die it is a few times the
            throws made.
    to_confirm: the same until a die with the given probabilities has, in the mean, shown to be
        within a total variation of `WITHIN`.
    """

    counts: Integers
    probabilities: Floats
    confidence: float
    intervals: Floats
    posterior: Posterior
    chi_square: ChiSquareTest
    exact: MultinomialTest | None
    variation: MeasuredDistance
    to_reject: int | None
    to_confirm: int

    @property
    def throws(self) -> int:
        """Number of throws."""
        return int(self.counts.sum())

    @property
    def frequencies(self) -> Floats:
        """(k,) summing to 1."""
        return np.asarray(self.counts / self.throws)

    @property
    def p_value(self) -> float:
        """p-value of the exact test if there is one, else of chi-square."""
        return self.chi_square.p_value if self.exact is None else self.exact.p_value

    @property
    def rejected(self) -> bool:
        """True if the die does not have the given probabilities, as far as the test can tell."""
        return self.p_value <= 1.0 - self.confidence


def judge_rolls(counts: ArrayLike, probabilities: ArrayLike, confidence: float) -> RollVerdict:
    """Judge the throws of a die.

    Parameters
    ----------
    counts: (k,) whole numbers of at least 0, not all 0; k at least 2.
    probabilities: (k,) positive, summing to 1.
    confidence: above 1 - `POWER`, below 1.
    """
    came, wanted = np.asarray(counts, dtype=np.int64), np.asarray(probabilities, dtype=np.float64)
    throws = int(came.sum())
    frequencies = came / throws
    rare = throws * wanted.min() < FEWEST_EXPECTED
    variation = measure_variation(came, wanted, confidence)
    different = variation.value > EQUAL_PROBABILITIES
    return RollVerdict(
        counts=came,
        probabilities=wanted,
        confidence=confidence,
        intervals=exact_intervals(came, throws, confidence),
        posterior=jeffreys_posterior(came, confidence),
        chi_square=chi_square(came, wanted),
        exact=exact_multinomial(came, wanted) if rare else None,
        variation=variation,
        to_reject=throws_to_reject(frequencies, wanted, 1.0 - confidence, POWER)
        if different
        else None,
        to_confirm=throws_to_confirm(wanted, WITHIN, confidence),
    )


def throws_to_reject(
    true_probabilities: ArrayLike, probabilities: ArrayLike, level: float, power: float
) -> int:
    """Number of throws after which Pearson's test at `level` rejects `probabilities` with
    probability `power`, for a die with `true_probabilities`.

    The statistic then has a noncentral chi-square distribution with k - 1 degrees of freedom.

    Parameters
    ----------
    true_probabilities, probabilities: (k,) different, summing to 1; `probabilities` positive.
    level, power: in (0, 1), the power larger than the level.

    Source: Cohen, Statistical Power Analysis, 1988, chapter 7.
    """
    p, q = (
        np.asarray(true_probabilities, dtype=np.float64),
        np.asarray(probabilities, dtype=np.float64),
    )
    effect = float((np.square(p - q) / q).sum())
    degrees = len(q) - 1
    noncentrality = float(chndtrinc(chdtri(degrees, level), degrees, 1.0 - power))
    return math.ceil(noncentrality / effect)


def throws_to_confirm(probabilities: ArrayLike, within: float, confidence: float) -> int:
    """Throws after which a die with these probabilities (k,) exactly has, in the mean, shown with
    `confidence` in (0, 1) that it is within a total variation `within` > 0 of them.

    It is where the upper limit of `measure_variation`, the noise floor plus what chance allows,
    falls to `within`, by the normal limit of the noise floor.
    """
    q = np.asarray(probabilities, dtype=np.float64)
    floor = float(np.sqrt(q * (1.0 - q) * 2.0 / math.pi).sum()) / 2.0
    return math.ceil(((floor + event_error(q, 1.0, confidence)) / within) ** 2)
