"""Many ranges of integers as one flat array."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["ragged_ranges"]

Integers = NDArray[np.int64]


def ragged_ranges(starts: Integers, counts: Integers) -> tuple[Integers, Integers]:
    """The ranges `starts[i] : starts[i] + counts[i]` one after the other.

    starts: (k,); counts: (k,) not negative. Returns (n,) the range i of each entry and (n,) the
    entry itself, n being the sum of the counts.
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    before = np.cumsum(counts) - counts
    return owner, (starts - before)[owner] + np.arange(len(owner))
