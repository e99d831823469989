"""Ranges of different lengths in one array."""

from __future__ import annotations

import numpy as np

from dicedesign.runtime.arrays import ragged_ranges


def test_ranges_are_concatenated() -> None:
    owner, index = ragged_ranges(np.array([5, -2, 9, 0]), np.array([2, 3, 0, 1]))
    np.testing.assert_array_equal(owner, [0, 0, 1, 1, 1, 3])
    np.testing.assert_array_equal(index, [5, 6, -2, -1, 0, 0])


def test_empty_ranges_are_skipped() -> None:
    empty = np.empty(0, dtype=np.int64)
    for starts, counts in ((empty, empty), (np.array([3, 4]), np.array([0, 0]))):
        owner, index = ragged_ranges(starts, counts)
        assert len(owner) == len(index) == 0
        assert index.dtype == np.int64
