"""Names of array types, ranges of integers as one flat array, and sums by index."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
"""Array of real numbers."""

Integers: TypeAlias = NDArray[np.int64]
"""Array of indices and counts."""

Booleans: TypeAlias = NDArray[np.bool_]
"""Array of truths."""


def ragged_ranges(starts: Integers, counts: Integers) -> tuple[Integers, Integers]:
    """The ranges `starts[i] : starts[i] + counts[i]` one after the other.

    starts: (k,); counts: (k,) not negative. Returns (n,) the range i of each entry and (n,) the
    entry itself, n being the sum of the counts.
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    before = np.cumsum(counts) - counts
    return owner, (starts - before)[owner] + np.arange(len(owner))


def sums_by_index(index: Integers, values: Floats, size: int) -> Floats:
    """(size, ...) sums of values (m, ...) over those with the same index (m,), in [0, size)."""
    columns = values.reshape(len(index), math.prod(values.shape[1:])).T
    sums: Floats = np.stack([np.bincount(index, column, size) for column in columns], axis=-1)
    return sums.reshape(size, *values.shape[1:])
