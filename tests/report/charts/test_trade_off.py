"""Drafts of a concave die, displacement against error."""

from __future__ import annotations

import numpy as np
import pytest
from common.drawings import is_whole

from dicedesign.report.charts.chart import Chart
from dicedesign.report.charts.series import Curve
from dicedesign.report.charts.trade_off import trade_off_chart, trade_off_figure
from dicedesign.results.parts import Draft, TradeOff

GOOD = Draft(3, 1.0, 1e-4, 0.02, 60.0, 15.0, 0)
DRAFTS = (
    GOOD,
    Draft(4, 1.0, 0.0, 0.05, 60.0, 15.0, 0),
    Draft(6, 1.0, 0.3, 0.01, 10.0, 1.0, 8),
    Draft(7, 1.0, 1e-3, 0.03, 60.0, 15.0, 2),
    Draft(8, 1.0, 1e-3, 0.04, 20.0, 15.0, 0),
    Draft(9, 1.0, 1e-3, 0.06, 60.0, 2.0, 0),
)
BEFORE = 0.42


def wanted(*drafts: Draft) -> TradeOff:
    return TradeOff(0.005, 45.0, 10.0, drafts)


def points(chart: Chart, label: str) -> list[tuple[float, float]]:
    """Of the series whose label begins so."""
    return [
        point
        for curve in chart.series
        if isinstance(curve, Curve) and curve.label.startswith(label)
        for point in zip(np.asarray(curve.x), np.asarray(curve.y), strict=True)
    ]


def test_every_draft_is_drawn_once_by_what_is_worst_of_it() -> None:
    chart = trade_off_chart(wanted(*DRAFTS), 7, BEFORE)
    labels = [series.label for series in chart.series if series.label.endswith(")")]
    counts = [int(label.rsplit("(", 1)[1][:-1]) for label in labels]
    assert counts == [2, 1, 1, 1, 1]
    drawn = [point for label in labels for point in points(chart, label)]
    zero = chart.y.low
    expected = [(100.0 * d.displacement, d.error or zero) for d in DRAFTS]
    np.testing.assert_allclose(drawn, expected)
    np.testing.assert_allclose(points(chart, "this die"), [(3.0, 1e-3)])
    np.testing.assert_allclose(points(chart, "the surface"), [(0.0, BEFORE)])
    assert {note.text for note in chart.notes} >= {"3", "4", "6", "7", "8", "9"}
    places = chart.places(*np.transpose([*drawn, (0.0, BEFORE)]))
    left, top, right, bottom = chart.box
    assert (places >= [left, top]).all()
    assert (places <= [right, bottom]).all()
    levels = [curve for curve in chart.series if isinstance(curve, Curve) and curve.style.line]
    assert [set(np.asarray(level.y)) for level in levels] == [{0.005}]


@pytest.mark.parametrize("drafts", [(), (GOOD,), (Draft(1, None, 0.0, 0.0, 0.0, 0.0, 0),)])
@pytest.mark.parametrize("before", [0.0, BEFORE])
def test_few_drafts_of_any_kind_are_drawn(drafts: tuple[Draft, ...], before: float) -> None:
    assert is_whole(trade_off_figure(wanted(*drafts), None, before))
