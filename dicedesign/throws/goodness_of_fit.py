"""Tests of counts against probabilities, their power, and the verdict of throws on a die."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, chdtri, chndtr, chndtrinc, gammaln, xlogy

from dicedesign.runtime.arrays import Floats, Integers, exact_intervals
from dicedesign.throws.distances import (
    MeasuredVariation,
    draw_counts,
    event_error,
    jeffreys_intervals,
    jeffreys_means,
    measure_variation,
)
from dicedesign.tolerances import EQUAL_LIKELIHOOD, EQUAL_PROBABILITIES

MAX_TABLES = 1_000_000
"""Largest number of possible counts that are enumerated; of more, `DRAWS` are drawn at random."""

DRAWS = 100_000

SEED = 0


@dataclass(frozen=True)
class ChiSquareTest:
    """Pearson's test.

    Attributes
    ----------
    statistic: at least 0; infinite if an impossible outcome came up.
    degrees: of freedom.
    p_value: probability of a statistic at least as large under the null hypothesis, for many
        throws; 1 without a degree of freedom.
    """

    statistic: float
    degrees: int
    p_value: float


@dataclass(frozen=True)
class MultinomialTest:
    """Exact multinomial test.

    Attributes
    ----------
    p_value: probability of counts that are at most as probable as the observed ones.
    tables: number of possible counts that were enumerated or drawn.
    standard_error: of the p-value; 0 if all possible counts were enumerated.
    """

    p_value: float
    tables: int
    standard_error: float


def chi_square(counts: ArrayLike, probabilities: ArrayLike) -> ChiSquareTest:
    """Pearson's test of whether counts (k,), not all 0, come from probabilities (k,) that sum to 1.

    Impossible outcomes that did not come up are left out.

    Source: Pearson, Philosophical Magazine 50, 1900.
    """
    came, p = np.asarray(counts, dtype=np.float64), np.asarray(probabilities, dtype=np.float64)
    possible = p > 0.0
    if came[~possible].any():
        return ChiSquareTest(math.inf, int(possible.sum()), 0.0)
    expected = came.sum() * p[possible]
    statistic = float((np.square(came[possible] - expected) / expected).sum())
    degrees = int(possible.sum()) - 1
    return ChiSquareTest(statistic, degrees, float(chdtrc(degrees, statistic)) if degrees else 1.0)


def exact_multinomial(counts: ArrayLike, probabilities: ArrayLike) -> MultinomialTest:
    """Exact test of whether counts come from given probabilities; unlike Pearson's it also holds
    for few throws and rare outcomes.

    All possible counts are enumerated. If there are more than `MAX_TABLES`, `DRAWS` are drawn at
    random with a fixed seed; the observed counts are added to them, so that no p-value is 0.

    Parameters
    ----------
    counts: (k,) whole numbers of at least 0, not all 0.
    probabilities: (k,) positive, summing to 1.
    """
    came, p = np.asarray(counts, dtype=np.int64), np.asarray(probabilities, dtype=np.float64)
    throws, kinds = int(came.sum()), len(p)
    observed = _log_likelihood(came, p)
    # Scale of the rounding errors: the sum of the terms' sizes.
    terms = 2.0 * gammaln(throws + 1.0) - observed
    observed = observed + EQUAL_LIKELIHOOD * terms
    tables = math.comb(throws + kinds - 1, kinds - 1)
    if tables <= MAX_TABLES:
        every = _all_log_likelihoods(throws, p)
        return MultinomialTest(min(1.0, float(np.exp(every[every <= observed]).sum())), tables, 0.0)
    hits = 1
    for drawn in draw_counts(p, throws, DRAWS, SEED):
        hits += int((_log_likelihood(drawn, p) <= observed).sum())
    p_value = hits / (1 + DRAWS)
    return MultinomialTest(p_value, 1 + DRAWS, math.sqrt(p_value * (1.0 - p_value) / (1 + DRAWS)))


def _log_likelihood(counts: Integers, probabilities: Floats) -> Floats:
    """Logarithms (...) of the probabilities of counts (..., k)."""
    of_orders = gammaln(counts.sum(-1) + 1.0) - gammaln(counts + 1.0).sum(-1)
    return np.asarray(of_orders + xlogy(counts, probabilities).sum(-1))


def _all_log_likelihoods(throws: int, probabilities: Floats) -> Floats:
    """Logarithms of the probabilities of all possible counts."""
    left = np.array([throws])
    likelihood = np.array([gammaln(throws + 1.0)])
    for p in probabilities[:-1]:
        # Extend each partial table by 0, 1, ... of its remaining throws.
        ways = left + 1
        starts = np.repeat(np.cumsum(ways) - ways, ways)
        count = np.arange(ways.sum()) - starts
        left = np.repeat(left, ways) - count
        likelihood = np.repeat(likelihood, ways) + count * math.log(p) - gammaln(count + 1.0)
    return np.asarray(likelihood + left * math.log(probabilities[-1]) - gammaln(left + 1.0))


LEVEL = 0.05
"""Level of the test: the share of correct dice that it rejects."""


def chances_noticed(target: Floats, rolls: int, biases: Floats) -> Floats:
    """(n,) probabilities that Pearson's test at the level `LEVEL` rejects dice, given by their
    probabilities minus the target (n, k).

    The counts of many rolls are taken as normal. target: (k,) positive, summing to 1; rolls: their
    number.
    """
    if len(target) == 1:
        return np.zeros(len(biases))
    shares = (biases**2 / target).sum(axis=1) - biases.sum(axis=1) ** 2
    critical = float(chdtri(len(target) - 1, LEVEL))
    below = chndtr(critical, len(target) - 1, rolls * np.maximum(shares, 0.0))
    return np.asarray(1.0 - below)


FEWEST_EXPECTED = 5.0
"""Smallest expected count for which Pearson's statistic is close to chi-square: Cochran,
Biometrics 10(4), 1954."""

POWER = 0.8
"""Power: probability with which a wrong die is to be rejected."""

WITHIN = 0.02
"""Total variation up to which a die counts as correct."""

ADVICE = (
    "Decide on a number of throws before you begin: if you stop as soon as p is small, good dice "
    "fail too."
)
"""Advice to those who see the verdict while they throw."""


@dataclass(frozen=True)
class RollVerdict:
    """Verdict of counts of k outcomes on given probabilities.

    Attributes
    ----------
    counts, probabilities: (k,) observed counts, and given probabilities.
    confidence: of all intervals; the level of the test is 1 - confidence.
    intervals: (k, 2) exact confidence intervals of the probabilities.
    posterior_means, posterior_intervals: (k,) and (k, 2) under Jeffreys' prior.
    chi_square: Pearson's test of the probabilities.
    exact: the exact test, if an outcome is expected fewer than `FEWEST_EXPECTED` times.
    variation: total variation of the die's probabilities from the given ones.
    to_reject: total number of throws after which a die with the observed frequencies as
        probabilities is rejected with probability `POWER`; None if these are the given
        probabilities. Since frequencies deviate by chance, it is a few times `throws` for a perfect
        die.
    to_confirm: total number of throws after which a die with the given probabilities is, on
        average, confirmed to be within a total variation of `WITHIN`.
    """

    counts: Integers
    probabilities: Floats
    confidence: float
    intervals: Floats
    posterior_means: Floats
    posterior_intervals: Floats
    chi_square: ChiSquareTest
    exact: MultinomialTest | None
    variation: MeasuredVariation
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
        """Whether the test rejects the given probabilities."""
        return self.p_value <= 1.0 - self.confidence

    @property
    def more_to_confirm(self) -> int:
        """Number of further throws up to `to_confirm`."""
        return max(0, self.to_confirm - self.throws)

    @property
    def summary(self) -> str:
        """Number of throws, p-value, and whether more throws are needed, in one line."""
        start = f"{self.throws:,} throws, p = {self.p_value:.2g}"
        if self.rejected:
            return f"{start}, which rejects the probabilities"
        more = self.more_to_confirm
        return f"{start}, {more:,} more to settle it" if more else f"{start}, enough to settle it"


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
    rare = throws * wanted.min() < FEWEST_EXPECTED
    variation = measure_variation(came, wanted, confidence)
    return RollVerdict(
        counts=came,
        probabilities=wanted,
        confidence=confidence,
        intervals=exact_intervals(came, throws, confidence),
        posterior_means=jeffreys_means(came),
        posterior_intervals=jeffreys_intervals(came, confidence),
        chi_square=chi_square(came, wanted),
        exact=exact_multinomial(came, wanted) if rare else None,
        variation=variation,
        to_reject=throws_to_reject(came / throws, wanted, 1.0 - confidence)
        if variation.value > EQUAL_PROBABILITIES
        else None,
        to_confirm=throws_to_confirm(wanted, WITHIN, confidence),
    )


def throws_to_reject(true_probabilities: ArrayLike, probabilities: ArrayLike, level: float) -> int:
    """Number of throws after which Pearson's test rejects `probabilities` with probability `POWER`,
    for a die with `true_probabilities`.

    The statistic then has a noncentral chi-square distribution with k - 1 degrees of freedom.

    Parameters
    ----------
    true_probabilities, probabilities: (k,) different, summing to 1; `probabilities` positive.
    level: of the test, in 0 to `POWER`.

    Source: Cohen, Statistical Power Analysis, 1988, chapter 7.
    """
    p, q = np.asarray(true_probabilities), np.asarray(probabilities, dtype=np.float64)
    effect = float((np.square(p - q) / q).sum())
    degrees = len(q) - 1
    noncentrality = float(chndtrinc(chdtri(degrees, level), degrees, 1.0 - POWER))
    return math.ceil(noncentrality / effect)


def throws_to_confirm(probabilities: ArrayLike, within: float, confidence: float) -> int:
    """Number of throws after which a die with exactly these probabilities (k,) is, on average,
    confirmed to be within a total variation `within` > 0 of them.

    The upper limit of `measure_variation`, noise floor plus sampling error, then falls to
    `within`, by the normal limit of the noise floor. confidence: in (0, 1).
    """
    q = np.asarray(probabilities, dtype=np.float64)
    floor = float(np.sqrt(q * (1.0 - q) * 2.0 / math.pi).sum()) / 2.0
    return math.ceil(((floor + event_error(q, 1.0, confidence)) / within) ** 2)
