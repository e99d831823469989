"""Names of array types, and many ranges of integers as one flat array."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Booleans", "Floats", "Integers", "ragged_ranges"]

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
