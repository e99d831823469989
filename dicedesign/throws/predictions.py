"""What a fitted table predicts of a die: checks against real throws, simulated and drawn, and what
more throws would tell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import xlogy

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.distances import jeffreys_means
from dicedesign.throws.goodness_of_fit import (
    ChiSquareTest,
    MultinomialTest,
    chi_square,
    exact_multinomial,
    two_sample_chi_square,
)
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table
from dicedesign.throws.throw_counts import CountedDie

SERIES: Final = 4000
"""Series of throws that are drawn for a p-value, whose standard error so is below 0.008."""


@dataclass(frozen=True)
class Prediction:
    """What came up with one die against what was predicted of it.

    Attributes
    ----------
    odds, deviation: (g,) mean and standard deviation of the odds by the prediction.
    p_value: part of predicted series of throws that go no better with the prediction than the real
        one, by the ratio of their likelihood by the prediction over that by their own frequencies.
    standard_error: of the p-value.
    worst: the outcome that came up most unlike the prediction.
    interval: that holds its count in 95 % of predicted series.
    """

    odds: Floats
    deviation: Floats
    p_value: float
    standard_error: float
    worst: int
    interval: tuple[int, int]


def predicted(counts: Integers, odds: Floats, rng: np.random.Generator) -> Prediction:
    """Counts (g,) against a prediction: equally likely odds (m, g).

    Source: Gelman, Meng and Stern, Statistica Sinica 6, 1996, with the likelihood ratio of the
    mixture of all odds as discrepancy.
    """
    throws = int(counts.sum())
    series = rng.multinomial(throws, odds[np.arange(SERIES) % len(odds)])
    both = np.concatenate([[counts], series])
    # In place: temporary arrays of this size take most of the time.
    likelihoods = np.logaddexp.reduce(both @ np.log(odds).T, axis=1)
    fits = likelihoods - xlogy(both, both / throws).sum(axis=1)
    # The real series counts as one more, so that no p-value is 0; equal ones differ by rounding.
    worse = int((fits <= fits[0] + 1e-9 * abs(fits[0])).sum())
    p_value = worse / len(both)
    spread = np.maximum(series.std(axis=0), 0.5)
    worst = int((np.abs(counts - series.mean(axis=0)) / spread).argmax())
    low, high = np.quantile(series[:, worst], [0.025, 0.975])
    return Prediction(
        odds.mean(axis=0),
        odds.std(axis=0),
        p_value,
        float(np.sqrt(p_value * (1.0 - p_value) / len(both))),
        worst,
        (round(low), round(high)),
    )


def expected_deviations(values: Floats, odds: Floats, throws: Sequence[int]) -> Floats:
    """Standard deviations (t, p) that are left of p parameters after each of t numbers of throws.

    The best estimate that is linear in the frequencies takes part of the variance, the more, the
    larger the covariance of a parameter with the odds is beside what sessions and chance do to the
    frequencies. Estimates that are not linear leave no more.

    Source: Goldstein and Wooff, Bayes Linear Statistics, 2007, section 1.3.

    Parameters
    ----------
    values: (m, p) equally likely sets of parameters, as they are known before.
    odds: (m, g) of the die in a session at each.
    throws: in one session.
    """
    known, part = values - values.mean(axis=0), odds - odds.mean(axis=0)
    covariance = known.T @ part / len(odds)
    between = part.T @ part / len(odds)
    chance = np.diag(odds.mean(axis=0)) - odds.T @ odds / len(odds)
    left = []
    for count in throws:
        # Frequencies sum to 1, which leaves one direction without variance.
        gain = covariance @ np.linalg.pinv(between + chance / count, hermitian=True) @ covariance.T
        left.append(np.sqrt(np.maximum(known.var(axis=0) - np.diag(gain), 0.0)))
    return np.array(left)


@dataclass(frozen=True)
class DieCheck:
    """Real throws of one die beside simulated ones.

    Attributes
    ----------
    die: what was thrown.
    simulated: (g,) how often each outcome came up in simulation.
    unresolved: simulated drops that ended nowhere.
    chi_square: whether real and simulated throws can have the same odds, whatever these are.
    exact: whether the real ones can have the odds simulated, as if those were known.
    geometric: whether the real ones can have the odds without momentum.
    """

    die: CountedDie
    simulated: Integers
    unresolved: int
    chi_square: ChiSquareTest
    exact: MultinomialTest
    geometric: ChiSquareTest

    @property
    def odds(self) -> Floats:
        """(g,) simulated odds, above 0, by the prior of Jeffreys."""
        return jeffreys_means(self.simulated)


def check_table(
    dice: Sequence[CountedDie],
    table: Table,
    drops: int,
    seed: int,
    *,
    workers: Executor | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[DieCheck, ...]:
    """Throw each die so many times on a table, and compare.

    Parameters and errors: as of `simulate`. Dice whose size is unknown have the table's; larger
    ones than it lets fall are let go from as high as they are large.
    """
    checks = []
    for die in dice:
        lifted = table.lifted(die.size)
        throws = simulate(die.body, lifted, drops, seed, workers=workers, progress=progress)
        simulated = die.by_outcome(throws.counts)
        checks.append(
            DieCheck(
                die=die,
                simulated=simulated,
                unresolved=throws.unresolved,
                chi_square=two_sample_chi_square(die.counts, simulated),
                exact=exact_multinomial(die.counts, jeffreys_means(simulated)),
                geometric=chi_square(die.counts, die.geometric),
            )
        )
    return tuple(checks)
