"""Bars of how far predictions are from what was thrown."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex

from dicedesign.errors import InputError
from dicedesign.report.charts.bar_chart import deviation_bars_figure
from dicedesign.report.charts.palette import ACCENT, PALE
from dicedesign.report.charts.png import png_bytes

GEOMETRIC = np.array([0.1, 0.3, 0.2])
MOMENTUM = np.array([0.05, 0.02, 0.04])
FLOORS = np.array([0.01, 0.03, 0.02])


def test_bars_in_descending_order_with_their_floors() -> None:
    figure = deviation_bars_figure({"a": GEOMETRIC, "b": MOMENTUM}, FLOORS, "title", "note")
    (axes,) = figure.axes
    heights: dict[str, list[float]] = {}
    for bar in axes.patches:
        heights.setdefault(to_hex(bar.get_facecolor()), []).append(bar.get_height())
    assert heights == {PALE: [0.3, 0.2, 0.1], ACCENT: [0.02, 0.04, 0.05]}
    (lines,) = axes.collections
    assert [path.vertices[0, 1] for path in lines.get_paths()] == [0.03, 0.02, 0.01]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "a: mean 0.200, worst 0.300",
        "b: mean 0.037, worst 0.050",
        "right odds, on the mean: 0.020",
    ]
    assert png_bytes(figure).startswith(b"\x89PNG")


def test_numbers_that_do_not_belong_together() -> None:
    with pytest.raises(InputError, match=r"got 2 predictions of 3, 3 dice and 2 floors"):
        deviation_bars_figure({"a": GEOMETRIC, "b": MOMENTUM}, FLOORS[:2], "title")
    with pytest.raises(InputError, match=r"got 1 predictions of 3 dice and 3 floors"):
        deviation_bars_figure({"a": GEOMETRIC}, FLOORS, "title")
