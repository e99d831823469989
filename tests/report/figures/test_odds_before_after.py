"""Bars before and after."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.figures.odds_before_after import odds_before_after_figure

TARGET = np.array([0.5, 0.3, 0.2])
BEFORE = np.array([0.1, 0.3, 0.4])
AFTER = np.array([0.49, 0.3, 0.205])


def test_bars_marks_and_what_lands_elsewhere() -> None:
    figure = odds_before_after_figure(["a", "b", "$c$"], TARGET, BEFORE, AFTER, 0.2, 0.005)
    (axes,) = figure.axes
    bars = [bar.get_height() for bar in axes.patches]
    expected = [10, 30, 40, 20, 49, 30, 20.5, 0.5]
    np.testing.assert_allclose(bars, expected)
    (marks,) = axes.collections
    ends = np.array(marks.get_segments())
    np.testing.assert_allclose(ends[:, :, 1], np.array([[50, 30, 20, 0]] * 2).T)
    # Each mark spans its two bars and no others.
    for k, ((left, _), (right, _)) in enumerate(ends):
        before, after = axes.patches[k], axes.patches[k + 4]
        assert left < before.get_x() < after.get_x() + after.get_width() < right
        assert before.get_x() + before.get_width() == pytest.approx(after.get_x())
    assert (ends[1:, 0, 0] > ends[:-1, 1, 0]).all()
    ticks = [tick.get_text() for tick in axes.get_xticklabels()]
    assert ticks == ["a", "b", "$c$", "elsewhere"]
    assert axes.get_title() == "max |p − q| = 0.4 before, 0.01 after"
    assert axes.get_ylabel() == "probability (%)"
    assert axes.get_ylim()[1] > 50
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert sorted(texts) == ["after", "before", "target"]
    png_bytes(figure)


@pytest.mark.parametrize(("count", "values"), [(1, 4), (12, 26), (13, 0), (40, 0)])
def test_values_are_written_for_few_outcomes(count: int, values: int) -> None:
    odds = np.full(count, 1.0 / count)
    figure = odds_before_after_figure([str(k) for k in range(count)], odds, odds, odds, 0.0, 0.0)
    assert len(figure.axes[0].texts) == values
    assert png_bytes(figure).startswith(b"\x89PNG")


def test_colours_tell_before_from_after_and_the_target() -> None:
    figure = odds_before_after_figure(["a", "b", "c"], TARGET, BEFORE, AFTER, 0.2, 0.0)
    (axes,) = figure.axes
    before, after = axes.patches[0].get_facecolor(), axes.patches[4].get_facecolor()
    mark = axes.collections[0].get_colors()[0]
    for one, other in ((before, after), (before, mark), (after, mark)):
        assert np.abs(np.subtract(one[:3], other[:3])).max() > 0.3


def test_arguments_must_match() -> None:
    with pytest.raises(InputError, match="got 1 labels, 3 targets, 3 before and 3 after"):
        odds_before_after_figure(["a"], TARGET, BEFORE, AFTER, 0.2, 0.0)
    with pytest.raises(InputError, match="at least one outcome"):
        odds_before_after_figure([], np.ones(0), np.ones(0), np.ones(0), 0.2, 0.0)
