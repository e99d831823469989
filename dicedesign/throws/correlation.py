"""The correlation of two measures of the same bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import pearsonr

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats

_FEWEST: Final = 4
"""Pairs from which on Fisher's interval is defined."""


@dataclass(frozen=True)
class Correlation:
    """Pearson's coefficient with its uncertainty.

    Attributes
    ----------
    coefficient: in [-1, 1].
    p_value: probability in [0, 1] of a coefficient at least as far from 0 when two normal variables
        are independent.
    interval: the coefficient's 95 % confidence interval, by Fisher's transform.
    pairs: how many bodies were measured.
    """

    coefficient: float
    p_value: float
    interval: tuple[float, float]
    pairs: int

    def __str__(self) -> str:
        # Adding zero takes the sign off a rounded zero.
        r, low, high = (round(value, 2) + 0.0 for value in (self.coefficient, *self.interval))
        return f"r = {r:.2f} [{low:.2f}, {high:.2f}], p = {self.p_value:.1g}"


def correlation(first: Floats, second: Floats) -> Correlation:
    """Pearson's correlation of two measures (n,) of the same bodies, n >= 4, any units.

    Raises InputError: the lengths differ, there are fewer than 4 bodies, a value is not finite, or
    a measure is the same of all bodies.
    """
    if first.shape != second.shape or first.ndim != 1 or len(first) < _FEWEST:
        raise InputError(
            f"correlation: expected two measures of the same {_FEWEST} or more bodies, got arrays "
            f"of shape {first.shape} and {second.shape}; measure more bodies, each twice"
        )
    for measure in (first, second):
        if not np.isfinite(measure).all() or np.ptp(measure) == 0.0:
            raise InputError(
                "correlation: expected finite values that differ between bodies, got values from "
                f"{measure.min():g} to {measure.max():g}; take other bodies"
            )
    pearson = pearsonr(first, second)
    low, high = pearson.confidence_interval()
    return Correlation(
        float(pearson.statistic), float(pearson.pvalue), (float(low), float(high)), len(first)
    )
