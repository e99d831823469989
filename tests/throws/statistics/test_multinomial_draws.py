"""Counts that are drawn in blocks."""

from __future__ import annotations

import numpy as np

from dicedesign.throws.goodness_of_fit import BLOCK, drawn_counts


def test_blocks_are_parts_of_one_series() -> None:
    odds = np.array([0.2, 0.3, 0.5])
    series = BLOCK // len(odds) + 1000
    blocks = list(drawn_counts(odds, 7, series, 4))
    assert len(blocks) == 2
    assert max(block.size for block in blocks) <= BLOCK
    expected = np.random.default_rng(4).multinomial(7, odds, size=series)
    np.testing.assert_array_equal(np.concatenate(blocks), expected)
