"""Axes, what is drawn between them, and legends."""

from __future__ import annotations

import numpy as np
import pytest
from common.drawings import is_whole, painted

from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, draw_legend, legend_height, sheet
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.series import (
    Band,
    Bars,
    Curve,
    Intervals,
    Levels,
    Note,
    Series,
    Style,
)

RED, BLUE = "#ff0000", "#0000ff"


def chart_of(*series: Series, **changes: object) -> Chart:
    values = {"x": Axis(0.0, 10.0, "time"), "y": Axis(0.0, 5.0, "height"), **changes}
    return Chart((100.0, 60.0, 500.0, 260.0), series=list(series), **values)


@pytest.mark.parametrize(
    ("axis", "texts"),
    [
        (Axis(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (Axis(0.0, 20.3), ["0.0", "2.5", "5.0", "7.5", "10.0", "12.5", "15.0", "17.5"]),
        (Axis(0.0, 126_000.0), ["0", "20,000", "40,000", "60,000", "80,000", "100,000", "120,000"]),
        (Axis(0.03, 12.0, log=True), ["10⁻¹", "10⁰", "10¹"]),
        (Axis(1e-17, 0.5, log=True), [f"10{power}" for power in ("⁻¹⁶", "⁻¹⁴", "⁻¹²", "⁻¹⁰")]),
        (Axis(1e-3, 1.0, log=True, zero=True), ["0", "10⁻³", "10⁻²", "10⁻¹", "10⁰"]),
        (Axis(0.0, 3.0, ticks=[(1.0, "a"), (2.0, "b")]), ["a", "b"]),
    ],
)
def test_ticks_are_round_and_inside(axis: Axis, texts: list[str]) -> None:
    marks = axis.marks()
    assert [text for _, text in marks][: len(texts)] == texts
    shares = axis.shares([place for place, _ in marks])
    assert (shares > -1e-9).all()
    assert (shares < 1.0 + 1e-9).all()


def test_every_range_has_a_few_ticks() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        span = 10.0 ** rng.uniform(-6, 6)
        low = span * rng.uniform(-100.0, 100.0)
        marks = Axis(low, low + span).marks()
        assert 3 <= len(marks) <= 10
        places = [place for place, _ in marks]
        np.testing.assert_allclose(np.diff(places), np.diff(places)[0], rtol=1e-6)
        assert len({text for _, text in marks}) == len(marks)


def test_places_follow_the_axes() -> None:
    chart = chart_of(y=Axis(1.0, 100.0, log=True))
    places = chart.places([0.0, 5.0, 10.0], [1.0, 10.0, 100.0])
    np.testing.assert_allclose(places, [(100, 260), (300, 160), (500, 60)])


def test_bars_are_as_tall_as_their_values() -> None:
    chart = chart_of(Bars([2.0, 7.0], [1.25, 4.0], 2.0, RED))
    rows, columns = np.nonzero(painted(sheet([chart]), RED))
    left = columns < 300
    assert np.ptp(columns[left]) + 1 == pytest.approx(80, abs=1)
    for side, height in ((left, 1.25), (~left, 4.0)):
        assert 260 - rows[side].min() == pytest.approx(40 * height, abs=1)


def test_bands_levels_and_intervals_lie_where_they_should() -> None:
    paper = sheet([chart_of(Band(2.5, 5.0, RED, alpha=1.0))])
    rows, columns = np.nonzero(painted(paper, RED))
    assert (rows.min(), columns.min(), columns.max()) == (60, 200, 299)
    paper = sheet([chart_of(Levels([5.0], [2.5], 2.0, Style(RED, width=4.0)))])
    rows, columns = np.nonzero(painted(paper, RED))
    assert abs(rows.mean() - 159.5) <= 1.0
    assert np.ptp(columns) + 1 == pytest.approx(80, abs=2)
    paper = sheet([chart_of(Intervals([5.0], [1.0], [3.0], color=RED))])
    rows, columns = np.nonzero(painted(paper, RED))
    assert np.ptp(rows) + 1 == pytest.approx(80, abs=3)
    assert abs(columns.mean() - 299.5) <= 1.0


def test_steps_keep_a_value_until_the_next() -> None:
    curve = Curve([0.0, 5.0, 10.0], [4.0, 2.0, 1.0], Style(RED, width=3.0), steps=True)
    red = painted(sheet([chart_of(curve)]), RED)
    # At a quarter of the width the first value, at three quarters the second.
    for column, height in ((200, 4.0), (400, 2.0)):
        assert np.flatnonzero(red[:, column]).mean() == pytest.approx(260 - 40 * height, abs=1.5)


@pytest.mark.parametrize("marker", ["o", "s", "D", "^", "v", "*", "x"])
def test_markers_are_in_the_middle_and_may_be_hollow(marker: str) -> None:
    areas = []
    for filled in (True, False):
        style = Style(RED, "", marker=marker, size=9.0, filled=filled)
        red = painted(sheet([chart_of(Curve([5.0], [2.5], style))]), RED)
        rows, columns = np.nonzero(red)
        assert abs((rows.min() + rows.max()) / 2 - 160) <= 3
        assert abs((columns.min() + columns.max()) / 2 - 300) <= 2
        areas.append(red.sum())
    assert (areas[1] < 0.8 * areas[0]) == (marker != "x")


def test_later_series_cover_earlier_ones() -> None:
    both = [Bars([5.0], [3.0], 2.0, color) for color in (RED, BLUE)]
    paper = sheet([chart_of(*both)])
    assert not painted(paper, RED).any()
    assert painted(paper, BLUE).any()


def test_titles_ticks_and_notes_are_written() -> None:
    chart = chart_of(
        title="a title", notes=[Note("here", 5.0, 2.0), Note("in", 0.5, 1.0, inside=True)]
    )
    paper = sheet([chart])
    assert {"a title", "time", "height", "here", "in", "0", "10"} <= set(paper.texts)
    assert is_whole(paper)
    chart.x = Axis(0.0, 10.0, "time", shown=False)
    assert "10" not in sheet([chart]).texts


@pytest.mark.parametrize("count", [2, 30])
def test_long_texts_of_ticks_are_turned_and_stay_apart(count: int) -> None:
    ticks = [(k + 0.5, f"label {k}") for k in range(count)]
    paper = sheet([chart_of(x=Axis(0.0, float(count), "outcome", ticks=ticks))], below=140.0)
    assert is_whole(paper)
    below = (paper.pixels()[275:, 100:500] < 128).any(axis=2)
    assert below[25:30].any() == (count == 30)


def test_a_legend_names_each_label_once() -> None:
    series = [
        Curve([], [], Style(RED), "one"),
        Band(0, 1, BLUE, "two", 1.0),
        Curve([], [], Style(RED), "one"),
    ]
    paper = Paper(600, 100)
    draw_legend(paper, [*series, Curve([], [], Style(RED))], (300.0, 20.0))
    assert paper.texts == ["one", "two"]
    red, blue = (np.nonzero(painted(paper, color)) for color in (RED, BLUE))
    assert red[1].max() < blue[1].min()
    assert abs(red[0].mean() - blue[0].mean()) < 2.0
    assert is_whole(paper)
    assert legend_height(series, 2) < legend_height(series, 1)
    rows = Paper(600, 100)
    draw_legend(rows, series, (10.0, 20.0), columns=1, align="left")
    assert np.nonzero(painted(rows, RED))[0].max() < np.nonzero(painted(rows, BLUE))[0].min()
    nothing = Paper(10, 10)
    draw_legend(nothing, [], (0.0, 0.0))
    assert nothing.texts == []
