"""What a posterior predicts of a die, and how well that goes with what came up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import xlogy

from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["Prediction", "predicted"]

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
