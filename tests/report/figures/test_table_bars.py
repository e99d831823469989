"""Odds on a table beside what was asked for, and the rounds that led there."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.figures.table_odds import refinement_figure, table_odds_figure

TARGET = [0.25, 0.5, 0.25]
GEOMETRIC = [0.2, 0.5, 0.3]
MOMENTUM = [0.24, 0.5, 0.26]


@pytest.fixture
def simulated() -> dict[str, Any]:
    return {
        "engine": "native",
        "drops": 12345,
        "unresolved": 0,
        "counts": [26, 50, 24],
        "frequencies": [0.26, 0.5, 0.24],
        "intervals": [[0.2, 0.3], [0.45, 0.55], [0.2, 0.28]],
        "total_variation": 0.01,
        "interval": [0.0, 0.0256],
        "noise_floor": 0.0123,
    }


def heights(axes) -> np.ndarray:
    return np.array([bar.get_height() for bar in axes.patches]).reshape(-1, 3)


def test_all_bars(simulated) -> None:
    thrown = {"momentum": MOMENTUM, "simulated": simulated}
    figure = table_odds_figure(["a", "b", "$c$"], TARGET, GEOMETRIC, thrown)
    (axes,) = figure.axes
    expected = 100.0 * np.array([TARGET, GEOMETRIC, MOMENTUM, simulated["frequencies"]])
    np.testing.assert_allclose(heights(axes), expected)
    # Bars of one outcome stand beside each other, within that of its target.
    left = np.array([bar.get_x() for bar in axes.patches]).reshape(-1, 3)
    right = left + np.array([bar.get_width() for bar in axes.patches]).reshape(-1, 3)
    np.testing.assert_allclose(left[2:], right[1:-1])
    assert (left[1] > left[0]).all()
    assert (right[-1] < right[0]).all()
    marks, bars = (np.array(lines.get_segments()) for lines in axes.collections)
    np.testing.assert_allclose(marks[:, 0, 1], 100.0 * np.array(TARGET))
    np.testing.assert_allclose(bars[:, :, 1], 100.0 * np.array(simulated["intervals"]))
    np.testing.assert_allclose(bars[:, 0, 0], (left + right)[-1] / 2)
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["a", "b", "$c$"]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "target",
        "without momentum",
        "momentum model",
        "simulated throws",
        "exact 95 % interval",
    ]
    assert axes.get_title() == (
        "12,345 throws: total variation 0.0100 (95 %: 0.0000 to 0.0256), a perfect die: 0.0123"
    )
    again = table_odds_figure(["a", "b", "$c$"], TARGET, GEOMETRIC, thrown)
    assert png_bytes(figure) == png_bytes(again)


def test_what_is_absent_is_left_out(simulated) -> None:
    figure = table_odds_figure(["a", "b", "c"], TARGET, GEOMETRIC, {"momentum": MOMENTUM})
    assert heights(figure.axes[0]).shape == (3, 3)
    assert figure.axes[0].get_title() == (
        "total variation to the target: without momentum 0.0500, momentum model 0.0100"
    )
    figure = table_odds_figure(["a", "b", "c"], TARGET, GEOMETRIC, {"simulated": simulated})
    np.testing.assert_allclose(heights(figure.axes[0])[2], [26.0, 50.0, 24.0])


@pytest.mark.parametrize("count", [1, 20, 40])
def test_texts_stay_within_the_figure_and_apart(count: int, simulated) -> None:
    odds = np.full(count, 1.0 / count)
    for key, value in (("frequencies", odds), ("intervals", np.stack([odds, odds], axis=1))):
        simulated[key] = value.tolist()
    labels = [str(100 + i) for i in range(count)]
    figure = table_odds_figure(labels, odds, odds, {"momentum": odds, "simulated": simulated})
    png_bytes(figure)
    (axes,) = figure.axes
    legend, title = axes.get_legend(), axes.title
    for text in (legend, title):
        box = text.get_window_extent()
        assert box.x0 > 0.0
        assert box.x1 < figure.bbox.width
        assert box.y1 < figure.bbox.height
    assert legend.get_window_extent().y1 < title.get_window_extent().y0
    # The legend is above every bar.
    tops = [bar.get_window_extent().y1 for bar in axes.patches]
    assert legend.get_window_extent().y0 > max(tops)
    boxes = [tick.get_window_extent() for tick in axes.get_xticklabels()]
    for one, other in pairwise(boxes):
        assert one.x1 < other.x0


@pytest.mark.parametrize("labels", [[], ["a", "b"]])
def test_one_of_each_for_each_outcome(labels) -> None:
    message = rf"got {len(labels)} labels, 3 targets and 3, 3 probabilities"
    with pytest.raises(InputError, match=message):
        table_odds_figure(labels, TARGET, GEOMETRIC, {"momentum": MOMENTUM})


def rounds() -> list[dict[str, Any]]:
    return [
        {"drops": 1000, "deviation": 0.1, "noise_floor": 0.02, "changed": []},
        {"drops": 1500, "deviation": 0.04, "noise_floor": 0.016, "changed": []},
    ]


def test_rounds_against_all_throws_so_far(simulated) -> None:
    figure = refinement_figure({"rounds": rounds(), "simulated": simulated})
    (axes,) = figure.axes
    curves = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_allclose(curves["die of the round"], [[1000, 0.1], [2500, 0.04]])
    np.testing.assert_allclose(
        curves["a perfect die"], [[1000, 0.02], [2500, 0.016], [14845, 0.0123]]
    )
    (segment,) = axes.collections[0].get_segments()
    np.testing.assert_allclose(segment, [[14845, 0.0], [14845, 0.0256]])
    assert axes.get_ylim()[0] == 0.0
    assert axes.get_ylim()[1] > 0.1
    again = refinement_figure({"rounds": rounds(), "simulated": simulated})
    assert png_bytes(figure) == png_bytes(again)


def test_rounds_on_changed_tables() -> None:
    both = [entry | {"changed": [0.2 - 0.1 * i, 0.3]} for i, entry in enumerate(rounds())]
    (axes,) = refinement_figure({"rounds": [*both, rounds()[0]]}).axes
    curves = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_allclose(curves["on a livelier table"], [[1000, 0.2], [2500, 0.1]])
    np.testing.assert_allclose(curves["on a duller table"], [[1000, 0.3], [2500, 0.3]])


def test_rounds_without_a_verdict() -> None:
    (axes,) = refinement_figure({"rounds": rounds()[:1]}).axes
    assert [line.get_label() for line in axes.lines] == ["die of the round", "a perfect die"]
    with pytest.raises(InputError, match="rounds: expected at least one, got none"):
        refinement_figure({"rounds": []})
