"""Bars and convergence."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.figures.bars import bars_figure
from dicedesign.report.figures.convergence import convergence_figure


def history(count: int) -> list[dict[str, object]]:
    return [
        {
            "step": k,
            "seconds": 0.1 * k,
            "energy": 2.0 * 0.99**k,
            "terms": {"dice": 2.0 * 0.99**k},
            "max_abs_error": 0.2 * 0.98**k,
        }
        for k in range(count)
    ]


def test_bars_show_both_distributions():
    target, achieved = np.array([0.25, 0.5, 0.25]), np.array([0.26, 0.5, 0.24])
    figure = bars_figure(["0", "1", "2"], target, achieved)
    (axes,) = figure.axes
    heights = [bar.get_height() for bar in axes.patches]
    np.testing.assert_allclose(heights, 100 * np.concatenate([target, achieved]))
    assert "max |p − q| = 0.01" in axes.get_title()
    assert "26.00" in [text.get_text() for text in axes.texts]
    assert axes.get_xlabel()
    assert axes.get_ylabel() == "probability (%)"


@pytest.mark.parametrize(("count", "values"), [(1, 2), (12, 24), (13, 0), (40, 0)])
def test_bars_write_values_for_few_outcomes(count, values):
    odds = np.full(count, 1.0 / count)
    figure = bars_figure([f"${k}$" for k in range(count)], odds, odds)
    assert len(figure.axes[0].texts) == values
    assert png_bytes(figure).startswith(b"\x89PNG")


def test_bars_need_matching_arguments():
    with pytest.raises(InputError, match="got 2 labels, 1 targets and 2 achieved"):
        bars_figure(["a", "b"], np.ones(1), np.ones(2))
    with pytest.raises(InputError, match="at least one outcome"):
        bars_figure([], np.ones(0), np.ones(0))


@pytest.mark.parametrize("count", [1, 2, 1000])
def test_convergence_is_drawn(count):
    figure = convergence_figure(history(count), 1e-3)
    left, right = figure.axes
    assert left.get_yscale() == "log"
    for axes in (left, right):
        assert axes.get_xlabel() == "run time (s)"
        assert axes.get_ylabel()
        assert len(axes.lines[0].get_xdata()) == count
    low, high = left.get_ylim()
    assert low < 1e-3 < high
    assert png_bytes(figure) == png_bytes(convergence_figure(history(count), 1e-3))


@pytest.mark.parametrize("start", [0.1, 0.0])
def test_convergence_shows_errors_of_zero(start):
    steps = [
        {"step": 0, "seconds": 0.0, "energy": 1.0, "terms": {}, "max_abs_error": start},
        {"step": 1, "seconds": 0.5, "energy": 0.0, "terms": {}, "max_abs_error": 0.0},
    ]
    figure = convergence_figure(steps, 1e-4)
    left = figure.axes[0]
    assert left.lines[0].get_ydata()[-1] == left.get_ylim()[0]
    assert "0" in [text.get_text() for text in left.texts]
    png_bytes(figure)


def test_energy_of_wide_range_is_logarithmic():
    steps = history(1000)
    assert convergence_figure(steps, 1e-3).axes[1].get_yscale() == "log"
    assert convergence_figure(steps[:10], 1e-3).axes[1].get_yscale() == "linear"


def test_of_preferences_the_energy_is_drawn_from_where_they_begin():
    steps = history(20)
    for step in steps[12:]:
        step["terms"]["preferences"] = 1.0
    left, right = convergence_figure(steps, 1e-3).axes
    assert len(left.lines[0].get_xdata()) == 20
    assert right.lines[0].get_ydata().tolist() == [step["energy"] for step in steps[12:]]
    assert right.get_ylabel() == "energy of preferences"


def test_convergence_needs_a_step():
    with pytest.raises(InputError, match="at least one step"):
        convergence_figure([], 1e-3)
