"""What a fit of a table to counts tells: the table, its uncertainty, and each die under it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dicedesign.runtime.arrays import Floats
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.fitting.predictive import Prediction
from dicedesign.throws.tables import Table

__all__ = ["BELIEF", "MORE", "DieFit", "FittedParameter", "TableFit"]

MORE: Final = (50, 100, 200, 400, 800, 1600)
"""Numbers of throws of which it is told what they would tell."""

BELIEF: Final = 0.9
"""Posterior probability of the interval of each parameter."""


@dataclass(frozen=True)
class FittedParameter:
    """One shared parameter by the counts, in the unit of `Table`.

    Attributes
    ----------
    fitted: its value in the fitted set.
    mean, deviation: of the posterior.
    interval: that holds it with the posterior probability `BELIEF`, as much below as above.
    limits: of the search, between which the prior is flat.
    """

    fitted: float
    mean: float
    deviation: float
    interval: tuple[float, float]
    limits: tuple[float, float]


@dataclass(frozen=True, eq=False)
class DieFit:
    """One die by the posterior.

    Attributes
    ----------
    die: with its counts, which may all be 0 where the die was not fitted to.
    odds, deviation: (g,) mean and standard deviation of its odds in a new session.
    whole: what the posterior of all counts predicts of more throws in the session of that die; its
        p-value is a little flattered, as the counts themselves are in the posterior. None for a die
        that was not fitted to.
    left_out: what the posterior of the other dice's counts alone predicts of a session of the die.
        None without counts.
    drawn: (m, g) equally likely odds in a new session, by the surrogate's best estimate.
    after: (t, 2) standard deviations of restitution and friction that `MORE` throws of the die
        would be expected to leave.
    """

    die: CountedDie
    odds: Floats
    deviation: Floats
    whole: Prediction | None
    left_out: Prediction | None
    drawn: Floats
    after: Floats


@dataclass(frozen=True)
class TableFit:
    """A fitted table with its uncertainty.

    Attributes
    ----------
    table: under which, as the hand of all sessions, the counts are likeliest; to three digits (see
        `SHARPNESS`).
    posterior: equally likely tables, each with the hand of a session drawn too.
    parameters: each of `PARAMETERS`, in that order; the hand is the center of all sessions.
    correlations: (5, 5) of the posterior, of the hand's logarithms.
    dice: those that were fitted to, and then those that were not.
    evaluations: sets of parameters that were simulated; drops: of each die for each set.
    log_likelihood: of the counts of all dice at `table`, by the surrogates, less what frequencies
        equal to the odds would give.
    surprise: root mean square deviation of simulated log odds from what the surrogates predict
        without them, in standard deviations: near 1 if they are right about their uncertainty.
    effective_points: of the points at which the posterior was computed, how many equal ones would
        be as good.
    """

    table: Table
    posterior: tuple[Table, ...]
    parameters: dict[str, FittedParameter]
    correlations: Floats
    dice: tuple[DieFit, ...]
    evaluations: int
    drops: int
    log_likelihood: float
    surprise: float
    effective_points: float
