"""Beliefs about each probability, from counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.runtime.arrays import Floats

__all__ = ["Posterior", "jeffreys_means", "jeffreys_posterior"]


@dataclass(frozen=True)
class Posterior:
    """Belief about k probabilities after some throws.

    Attributes
    ----------
    means: (k,) summing to 1.
    intervals: (k, 2) that hold each probability with the asked-for belief, and leave as much below
        as above.
    """

    means: Floats
    intervals: Floats


def jeffreys_means(counts: ArrayLike) -> Floats:
    """The means (k,) of `jeffreys_posterior`: odds above 0 that sum to 1."""
    weights: Floats = np.asarray(counts, dtype=np.float64) + 0.5
    return weights / weights.sum()


def jeffreys_posterior(counts: ArrayLike, confidence: float) -> Posterior:
    """Belief about k probabilities after `counts` (k,), at least 0, by the prior of Jeffreys, a
    Dirichlet distribution with all parameters 1/2, of which `counts` makes one with `counts` + 1/2.

    confidence: belief in (0, 1) that each interval holds its probability.

    Source: Jeffreys, Proc. R. Soc. A 186, 1946.
    """
    weights = np.asarray(counts, dtype=np.float64) + 0.5
    others = weights.sum() - weights
    from scipy.special import betaincinv

    # What lies above, too, by its own small part: 1 less a very small one is rounded to 1.
    tail = (1.0 - confidence) / 2.0
    limits = [betaincinv(weights, others, tail), 1.0 - betaincinv(others, weights, tail)]
    return Posterior(jeffreys_means(counts), np.stack(limits, axis=-1))
