"""Errors against run times on logarithmic axes."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.charts.time_curves import (
    DISTINCT,
    ErrorCurve,
    ErrorPanel,
    error_against_time_figure,
)

LEVELS = {"float64 rounding": 2.0**-53}


def panel(title: str, *errors: float) -> ErrorPanel:
    seconds = tuple(10.0 ** (k - 3) for k in range(len(errors)))
    exact = ErrorCurve("exact", (1e-3,), (errors[-1],), color=DISTINCT[1], marker="*", line="")
    return ErrorPanel(title, (ErrorCurve("sampled", seconds, errors), exact))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7])
def test_panels_share_axes_and_a_legend(count: int) -> None:
    panels = [panel(f"body {k}", 1e-1, 10.0 ** -(k + 2)) for k in range(count)]
    figure = error_against_time_figure(panels, LEVELS)
    assert [axes.get_title() for axes in figure.axes] == [f"body {k}" for k in range(count)]
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in figure.axes}) == 1
    for axes in figure.axes:
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert axes.get_ylim()[0] < 2.0**-53
        assert axes.get_xlim()[0] < 1e-3 < 1e-2 < axes.get_xlim()[1]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["sampled", "exact"]
    assert "float64 rounding" in [text.get_text() for text in figure.axes[0].texts]
    assert png_bytes(figure).startswith(b"\x89PNG")


def test_text_stays_inside_and_apart() -> None:
    labels = [f"a method with a long name, number {k}" for k in range(8)]
    curves = tuple(ErrorCurve(label, (1e-3,), (1e-3,)) for label in labels)
    for count in (1, 2, 3):
        figure = error_against_time_figure([ErrorPanel("body", curves)] * count, LEVELS)
        figure.canvas.draw()
        legend = figure.legends[0].get_window_extent()
        axes = figure.axes[0].get_tightbbox()
        assert axes.y0 > legend.y1
        assert axes.x0 >= 0.0


def test_zeros_are_drawn_at_the_border_and_marked() -> None:
    with_zero, without = panel("with", 1e-2, 0.0), panel("without", 1e-2, 1e-4)
    first, second = error_against_time_figure([with_zero, without], LEVELS).axes
    floor = first.get_ylim()[0]
    drawn = {line.get_label(): line.get_ydata() for line in first.lines}
    np.testing.assert_array_equal(drawn["sampled"], [1e-2, floor])
    np.testing.assert_array_equal(drawn["exact"], [floor])
    assert "border: error 0" in [text.get_text() for text in first.texts]
    assert "border: error 0" not in [text.get_text() for text in second.texts]


def test_nothing_but_zeros_can_be_drawn() -> None:
    figure = error_against_time_figure([panel("all exact", 0.0)], {})
    low, high = figure.axes[0].get_ylim()
    assert 0.0 < low < high
    assert png_bytes(figure).startswith(b"\x89PNG")


def test_earlier_curves_lie_above_later_ones() -> None:
    figure = error_against_time_figure([panel("body", 1e-2, 1e-4)], {})
    order = {line.get_label(): line.get_zorder() for line in figure.axes[0].lines}
    assert order["sampled"] > order["exact"]


@pytest.mark.parametrize(
    "panels",
    [
        [],
        [ErrorPanel("empty", ())],
        [panel("body", 1e-2), ErrorPanel("empty", (ErrorCurve("none", (), ()),))],
    ],
)
def test_each_panel_needs_a_point(panels: list[ErrorPanel]) -> None:
    with pytest.raises(InputError, match="expected a point in each panel"):
        error_against_time_figure(panels, LEVELS)


@pytest.mark.parametrize(
    ("seconds", "error"), [(0.0, 1e-3), (-1.0, 1e-3), (1.0, -1e-3), (1.0, float("nan"))]
)
def test_values_must_fit_logarithmic_axes(seconds: float, error: float) -> None:
    curve = ErrorCurve("odd", (seconds,), (error,))
    with pytest.raises(InputError, match="positive run times and errors of at least 0"):
        error_against_time_figure([ErrorPanel("body", (curve,))], LEVELS)
