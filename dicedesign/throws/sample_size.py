"""How many throws it takes to tell whether a die has its odds."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, chndtrinc, ndtri

__all__ = ["throws_to_confirm", "throws_to_reject"]


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
