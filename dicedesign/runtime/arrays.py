"""Array types, concatenated ranges, sums by index, and confidence intervals of probabilities."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]
"""Array of real numbers."""

Integers: TypeAlias = NDArray[np.int64]
"""Array of indices and counts."""

Booleans: TypeAlias = NDArray[np.bool_]
"""Array of truth values."""


def ragged_ranges(starts: Integers, counts: Integers) -> tuple[Integers, Integers]:
    """Concatenate the ranges `starts[i] : starts[i] + counts[i]`.

    starts: (k,); counts: (k,) not negative. Returns (n,) the range i of each entry and (n,) the
    entry itself, n being the sum of the counts.
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    before = np.cumsum(counts) - counts
    return owner, (starts - before)[owner] + np.arange(len(owner))


def sums_by_index(index: Integers, values: Floats, size: int) -> Floats:
    """Sum values (m, ...) with the same index (m,), in [0, size); returns (size, ...)."""
    columns = values.reshape(len(index), math.prod(values.shape[1:])).T
    sums: Floats = np.stack([np.bincount(index, column, size) for column in columns], axis=-1)
    return sums.reshape(size, *values.shape[1:])


def exact_intervals(counts: ArrayLike, throws: float, confidence: float) -> Floats:
    """Lower and upper limits (..., 2) of the probabilities of outcomes with `counts` (...).

    For any probability, its interval contains it in at least the share `confidence`, in (0, 1), of
    all series of throws.

    Parameters
    ----------
    counts: from 0 to `throws`; effective numbers, not whole, if throws depend on each other.
    throws: number of all throws; with 0, the limits are 0 and 1.

    Source: Clopper and Pearson, Biometrika 26(4), 1934.
    """
    from scipy.special import betaincinv

    hits = np.asarray(counts, dtype=np.float64)
    misses, tail = throws - hits, (1.0 - confidence) / 2.0
    # At its ends, the beta distribution has no second parameter, and the limit is 0 or 1.
    lower = np.where(hits > 0, betaincinv(np.maximum(hits, 1), misses + 1, tail), 0.0)
    upper = np.where(misses > 0, 1.0 - betaincinv(np.maximum(misses, 1), hits + 1, tail), 1.0)
    return np.stack([lower, upper], axis=-1)
