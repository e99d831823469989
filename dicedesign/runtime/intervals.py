"""Exact intervals of a probability, from counts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.runtime.arrays import Floats


def exact_intervals(counts: ArrayLike, throws: float, confidence: float) -> Floats:
    """Lower and upper limits (..., 2) of the probabilities of what came up `counts` (...) times.

    Whatever the probability is, its interval holds it in at least the part `confidence`, in (0, 1),
    of all series of throws.

    Parameters
    ----------
    counts: from 0 to `throws`; whole numbers, or fewer where throws depend on each
        other.
    throws: how many in all; 0 says nothing about any.

    Source: Clopper and Pearson, Biometrika 26(4), 1934.
    """
    from scipy.special import betaincinv

    came = np.asarray(counts, dtype=np.float64)
    tail = (1.0 - confidence) / 2.0
    # At the ends, where the beta distribution has no second parameter, the limit is 0 or 1.
    lower = np.where(came > 0, betaincinv(np.maximum(came, 1), throws - came + 1, tail), 0.0)
    missed = throws - came
    upper = np.where(missed > 0, 1.0 - betaincinv(np.maximum(missed, 1), came + 1, tail), 1.0)
    return np.stack([lower, upper], axis=-1)
