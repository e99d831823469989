"""How well a table would be known after more throws of a die."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dicedesign.runtime.arrays import Floats

__all__ = ["expected_deviations"]


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
