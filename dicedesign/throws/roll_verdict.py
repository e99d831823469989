"""The verdict of a die's throws on its odds, and the numbers of throws that a verdict takes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, chndtrinc, ndtri

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.intervals import exact_intervals
from dicedesign.throws.distances import (
    MeasuredDistance,
    Posterior,
    jeffreys_posterior,
    measure_variation,
)
from dicedesign.throws.goodness_of_fit import (
    ChiSquareTest,
    MultinomialTest,
    chi_square,
    exact_multinomial,
)
from dicedesign.tolerances import EQUAL_ODDS

FEWEST_EXPECTED: Final = 5.0
"""Of an outcome that is expected less often the statistic of Pearson's test is not distributed as
it supposes: Cochran, Biometrics 10(4), 1954."""

POWER: Final = 0.8
"""Probability with which a wrong die is to be found out."""

WITHIN: Final = 0.02
"""Total variation up to which a die counts as right."""


@dataclass(frozen=True)
class RollVerdict:
    """The verdict of counts of k outcomes on given odds.

    Attributes
    ----------
    counts, odds: (k,) what came up, and what was to come up.
    confidence: of all intervals; 1 less is the level of the test.
    intervals: (k, 2) exact limits of each probability.
    posterior: belief about the probabilities, by the prior of Jeffreys.
    chi_square: Pearson's test of the odds.
    exact: the exact test, where an outcome is expected fewer than 5 times.
    variation: total variation of the die's odds from the given ones.
    to_reject: throws, those made among them, after which a die whose odds are the frequencies seen
        is rejected with probability `POWER`; None if these are the given odds. Frequencies deviate
        by chance, too: of a perfect die it is a few times the throws made.
    to_confirm: the same until a die with the given odds has, in the mean, shown to be within a
        total variation of `WITHIN`.
    """

    counts: Integers
    odds: Floats
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
        """That of the exact test where there is one."""
        return self.chi_square.p_value if self.exact is None else self.exact.p_value

    @property
    def rejected(self) -> bool:
        """True if the die does not have the given odds, as far as the test can tell."""
        return self.p_value <= 1.0 - self.confidence


def judge_rolls(counts: ArrayLike, odds: ArrayLike, confidence: float) -> RollVerdict:
    """Judge the throws of a die.

    Parameters
    ----------
    counts: (k,) whole numbers of at least 0, not all 0; k at least 2.
    odds: (k,) positive, summing to 1.
    confidence: above 1 - `POWER`, below 1.
    """
    came, wanted = np.asarray(counts, dtype=np.int64), np.asarray(odds, dtype=np.float64)
    throws = int(came.sum())
    frequencies = came / throws
    rare = throws * wanted.min() < FEWEST_EXPECTED
    variation = measure_variation(came, wanted, confidence)
    different = variation.value > EQUAL_ODDS
    return RollVerdict(
        counts=came,
        odds=wanted,
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


def throws_to_reject(true_odds: ArrayLike, odds: ArrayLike, level: float, power: float) -> int:
    """Throws after which Pearson's test at `level` rejects `odds` with probability `power`, if
    those of the die are `true_odds`.

    The statistic then has a noncentral chi-square distribution with k - 1 degrees of freedom.

    Parameters
    ----------
    true_odds, odds: (k,) different, summing to 1; `odds` positive.
    level, power: in (0, 1), the power larger than the level.

    Source: Cohen, Statistical Power Analysis, 1988, chapter 7.
    """
    p, q = np.asarray(true_odds, dtype=np.float64), np.asarray(odds, dtype=np.float64)
    effect = float((np.square(p - q) / q).sum())
    degrees = len(q) - 1
    noncentrality = float(chndtrinc(chdtri(degrees, level), degrees, 1.0 - power))
    return math.ceil(noncentrality / effect)


def throws_to_confirm(odds: ArrayLike, within: float, confidence: float) -> int:
    """Throws after which a die with these odds (k,) exactly has, in the mean, shown with
    `confidence` in (0, 1) that it is within a total variation `within` > 0 of them.

    It is where the upper limit of `measure_variation`, the noise floor plus what chance allows,
    falls to `within`, by the normal limit of the noise floor.
    """
    q = np.asarray(odds, dtype=np.float64)
    floor = float(np.sqrt(q * (1.0 - q) * 2.0 / math.pi).sum()) / 2.0
    most = max(0.5, float(q.max()))
    chance = -float(ndtri((1.0 - confidence) / 2.0)) * math.sqrt(most * (1.0 - most))
    return math.ceil(((floor + chance) / within) ** 2)
