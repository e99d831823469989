"""Drawn counts of what comes up in many series of throws, in blocks that fit into memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["drawn_counts"]

BLOCK: Final = 1_000_000
"""Counts of a block, at most, unless one series has more."""


def drawn_counts(odds: Floats, throws: int, series: int, seed: int) -> Iterator[Integers]:
    """Counts (b, k) of so many series of throws in all, drawn with odds (k,).

    How many come at a time does not change them.
    """
    random, at_once = np.random.default_rng(seed), max(1, BLOCK // len(odds))
    for first in range(0, series, at_once):
        yield random.multinomial(throws, odds, size=min(at_once, series - first))
