"""Run times against sizes on logarithmic axes."""

from __future__ import annotations

import pytest

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.charts.time_against_size import TimeCurve, time_against_size_figure

HULL = TimeCurve("hull", (10, 1000, 100_000), (1e-5, 1e-3, 1e-1))
QUERY = TimeCurve("query", (10, 1000), (2e-5, 2e-3))


def test_curves_are_drawn_on_logarithmic_axes_and_named() -> None:
    figure = time_against_size_figure([HULL, QUERY], "title", "points", "two cores, today")
    (axes,) = figure.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert (axes.get_title(), axes.get_xlabel()) == ("title", "points")
    assert [line.get_xdata().tolist() for line in axes.lines] == [[10, 1000, 100_000], [10, 1000]]
    assert axes.lines[1].get_ydata().tolist() == [2e-5, 2e-3]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["hull", "query"]
    assert [text.get_text() for text in figure.texts] == ["two cores, today"]
    assert png_bytes(figure).startswith(b"\x89PNG")


def test_many_curves_differ() -> None:
    figure = time_against_size_figure([HULL] * 5, "title", "points", "")
    looks = {(line.get_color(), line.get_marker()) for line in figure.axes[0].lines}
    assert len(looks) == 5


def test_text_stays_inside_and_apart() -> None:
    note = "Linux x86_64, 128 cores; processor time, one thread; dicedesign 0.1.0, 2026-11-21"
    figure = time_against_size_figure([HULL, QUERY], "title", "points", note)
    figure.canvas.draw()
    foot = figure.texts[0].get_window_extent()
    axes = figure.axes[0].get_tightbbox()
    assert axes.y0 > foot.y1
    assert axes.x0 >= 0.0
    assert axes.y1 <= figure.bbox.y1
    assert foot.x1 <= figure.bbox.x1


@pytest.mark.parametrize("curves", [[], [HULL, TimeCurve("none", (), ())]])
def test_each_curve_needs_a_point(curves: list[TimeCurve]) -> None:
    with pytest.raises(InputError, match="expected a point of each curve"):
        time_against_size_figure(curves, "title", "points", "")


@pytest.mark.parametrize(("size", "seconds"), [(0, 1.0), (10, 0.0), (10, -1.0), (10, float("nan"))])
def test_values_must_fit_logarithmic_axes(size: float, seconds: float) -> None:
    with pytest.raises(InputError, match="positive sizes and times"):
        time_against_size_figure([TimeCurve("odd", (size,), (seconds,))], "title", "points", "")
