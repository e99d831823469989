"""Ranges of different lengths in one array."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.runtime.arrays import ragged_ranges


@pytest.mark.parametrize(
    ("starts", "counts", "owners", "entries"),
    [
        ([5, -2, 9, 0], [2, 3, 0, 1], [0, 0, 1, 1, 1, 3], [5, 6, -2, -1, 0, 0]),
        ([3, 4], [0, 0], [], []),
        ([], [], [], []),
    ],
)
def test_ranges_are_concatenated(
    starts: list[int], counts: list[int], owners: list[int], entries: list[int]
) -> None:
    owner, index = ragged_ranges(np.array(starts, np.int64), np.array(counts, np.int64))
    assert (owner.tolist(), index.tolist()) == (owners, entries)
    assert index.dtype == np.int64
