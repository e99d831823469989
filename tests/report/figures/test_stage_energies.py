"""Energy and error over the stages of a design."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.figures.stage_energies import stage_energies_figure

HISTORY: list[dict[str, Any]] = [
    {"seconds": 0.0, "stage": "hull design", "energy": 1.0, "error": 0.3},
    {"seconds": 1.0, "stage": "hull design", "energy": 0.1, "error": 0.01},
    {"seconds": 1.5, "stage": "fill", "energy": 50.0, "error": None},
    {"seconds": 3.0, "stage": "fill", "energy": 40.0, "error": 0.02},
    {"seconds": 3.5, "stage": "hull design", "energy": 0.01, "error": 0.001},
]


def stretches(axes: Axes) -> list[Rectangle]:
    return [patch for patch in axes.patches if isinstance(patch, Rectangle)]


def test_each_stage_has_its_stretch_and_its_curve() -> None:
    figure = stage_energies_figure(HISTORY)
    errors, energies = figure.axes
    for axes in (errors, energies):
        spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in stretches(axes)]
        np.testing.assert_allclose(spans, [(0.0, 1.0), (1.0, 3.0), (3.0, 3.5)])
        first, second, third = (patch.get_facecolor() for patch in stretches(axes))
        assert first == third != second
        assert axes.get_yscale() == "log"
        assert axes.get_xlabel() == "run time (s)"
    curves = [np.array(line.get_data()).T.tolist() for line in energies.lines]
    assert curves == [[[0.0, 1.0], [1.0, 0.1]], [[1.5, 50.0], [3.0, 40.0]], [[3.5, 0.01]]]
    assert energies.lines[2].get_marker() == "o"
    low, high = energies.get_ylim()
    assert low < 0.01 < 50.0 < high


def test_the_error_is_one_curve_through_the_steps_where_it_is_known() -> None:
    errors = stage_energies_figure(HISTORY).axes[0]
    (line,) = errors.lines
    np.testing.assert_allclose(line.get_xdata(), [0.0, 1.0, 3.0, 3.5])
    np.testing.assert_allclose(line.get_ydata(), [0.3, 0.01, 0.02, 0.001])
    assert "max |p − q|" in errors.get_ylabel()


def test_the_legend_names_each_stage_once_in_its_colour() -> None:
    figure = stage_energies_figure(HISTORY)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["hull design", "fill"]
    spans = stretches(figure.axes[0])
    for patch, span in zip(legend.get_patches(), spans, strict=False):
        assert to_rgb(patch.get_facecolor()) == to_rgb(span.get_facecolor())


def test_zeros_are_drawn_on_a_border_marked_0() -> None:
    steps = [
        {**step, "energy": 0.0 if k == 1 else step["energy"]} for k, step in enumerate(HISTORY)
    ]
    errors, energies = stage_energies_figure(steps).axes
    assert energies.lines[0].get_ydata()[1] == energies.get_ylim()[0]
    assert "0" in [text.get_text() for text in energies.texts]
    assert "0" not in [text.get_text() for text in errors.texts]


@pytest.mark.parametrize("error", [None, 0.0])
def test_without_errors_or_with_none_but_zeros_the_figure_is_drawn(error: float | None) -> None:
    steps = [{**step, "error": error} for step in HISTORY]
    figure = stage_energies_figure(steps)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == (["not known"] if error is None else ["0"])
    png_bytes(figure)


def test_many_steps_in_one_instant_are_drawn() -> None:
    steps = [{"seconds": 0.0, "stage": "polish", "energy": 1.0, "error": 0.1}] * 200
    figure = stage_energies_figure(steps)
    assert figure.axes[1].lines[0].get_marker() == ""
    assert png_bytes(figure) == png_bytes(stage_energies_figure(steps))


def test_an_empty_history_is_refused() -> None:
    with pytest.raises(InputError, match="at least one step"):
        stage_energies_figure([])
