"""Frequencies beside odds."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.figures.rolls import rolls_figure
from dicedesign.throws.counts.roll_verdict import judge_rolls


def test_bars_intervals_and_counts() -> None:
    verdict = judge_rolls([30, 50, 20], [0.25, 0.5, 0.25], 0.9)
    figure = rolls_figure(["a", "b", "$c$"], verdict)
    (axes,) = figure.axes
    heights = [bar.get_height() for bar in axes.patches]
    np.testing.assert_allclose(heights, [25, 50, 25, 30, 50, 20])
    segments = np.array(axes.collections[0].get_segments())
    np.testing.assert_allclose(segments[:, :, 1], 100 * verdict.intervals)
    assert [text.get_text() for text in axes.texts] == ["30", "50", "20"]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["a", "b", "$c$"]
    legend = sorted(text.get_text() for text in axes.get_legend().get_texts())
    assert legend == ["exact 90 % interval", "odds tested", "thrown"]
    assert axes.get_title().startswith("100 throws: p = 0.37, total variation 0.050 (a perfect die")
    assert axes.get_ylim()[1] > 100 * verdict.intervals.max()
    png_bytes(figure)


@pytest.mark.parametrize("outcomes", [2, 30])
def test_few_and_many_outcomes_fit(outcomes: int) -> None:
    counts = np.arange(outcomes) + 1
    verdict = judge_rolls(counts, np.full(outcomes, 1 / outcomes), 0.95)
    labels = [f"label {i}" for i in range(outcomes)]
    figure = rolls_figure(labels, verdict)
    png_bytes(figure)
    (axes,) = figure.axes
    assert len(axes.texts) == (outcomes if outcomes < 17 else 0)


def test_a_label_for_each_outcome() -> None:
    with pytest.raises(InputError, match=r"rolls: expected 2 labels, one for each outcome, got 1"):
        rolls_figure(["a"], judge_rolls([1, 2], [0.5, 0.5], 0.95))
