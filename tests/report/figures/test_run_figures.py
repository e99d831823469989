"""Curves over the run time of a design, and over the rounds of throws."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from common.drawings import curves, is_whole

from dicedesign.errors import InputError
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.series import Band, Bars, Curve, Intervals
from dicedesign.report.figures.bars import bars_chart
from dicedesign.report.figures.convergence import convergence_charts
from dicedesign.report.figures.energy import energy_charts, energy_figure
from dicedesign.report.figures.odds import before_after_chart
from dicedesign.report.figures.rounds import rounds_chart
from dicedesign.report.figures.table import table_chart
from dicedesign.results.parts import RoundOfThrows, SimulatedThrows, ThrownOdds
from dicedesign.results.result import Step

TOLERANCE = 1e-3


def history(count: int) -> list[Step]:
    return [
        Step(k, 0.1 * k, 2.0 * 0.99**k, 0.2 * 0.98**k, {"dice": 2.0 * 0.99**k})
        for k in range(count)
    ]


def drawn(chart: Chart) -> list[Curve]:
    """Curves but those of levels."""
    return [c for c in chart.series if isinstance(c, Curve) and c.style.line != "--"]


@pytest.mark.parametrize("count", [1, 2, 1000])
def test_error_and_energy_over_time(count: int) -> None:
    charts = convergence_charts(history(count), TOLERANCE)
    left, right = charts
    assert left.y.log
    assert left.y.low < TOLERANCE < left.y.high
    for chart, key in ((left, "max_abs_error"), (right, "energy")):
        (curve,) = drawn(chart)
        np.testing.assert_allclose(curve.x, [step.seconds for step in history(count)])
        np.testing.assert_allclose(curve.y, [getattr(step, key) for step in history(count)])
        assert bool(curve.style.marker) == (count <= 60)
    assert right.y.log == (count == 1000)
    assert is_whole(sheet(charts))


def test_without_a_clock_steps_are_counted() -> None:
    steps = [replace(step, seconds=None) for step in history(30)]
    for chart in (*convergence_charts(steps, TOLERANCE), *energy_charts(steps)):
        (curve,) = drawn(chart)
        np.testing.assert_allclose(curve.x, range(30))
        assert "time" not in chart.title + chart.x.label
        assert is_whole(sheet([chart]))


@pytest.mark.parametrize("start", [0.1, 0.0])
def test_errors_of_zero_are_drawn_on_the_border(start: float) -> None:
    steps = [Step(0, 0.0, 1.0, start), Step(1, 0.5, 0.0, 0.0)]
    charts = convergence_charts(steps, 1e-4)
    left = charts[0]
    (curve,) = drawn(left)
    assert curve.y[-1] == left.y.low
    assert left.y.marks()[0] == (left.y.low, "0")
    assert is_whole(sheet(charts))


def test_of_preferences_the_energy_is_drawn_from_where_they_begin() -> None:
    steps = history(20)
    steps[12:] = [replace(step, terms={"preferences": 1.0}) for step in steps[12:]]
    left, right = convergence_charts(steps, TOLERANCE)
    assert len(drawn(left)[0].x) == 20
    assert drawn(right)[0].y.tolist() == [step.energy for step in steps[12:]]
    assert right.y.label == "energy of preferences"


STAGES = [
    Step(0, 0.0, 1.0, 0.3, stage="hull"),
    Step(1, 1.0, 0.1, 0.01, stage="hull"),
    Step(2, 1.5, 50.0, None, stage="fill"),
    Step(3, 3.0, 40.0, 0.02, stage="fill"),
    Step(4, 3.5, 0.01, 0.001, stage="hull"),
]


def test_each_stage_has_its_stretch_and_its_curve() -> None:
    errors, energies = energy_charts(STAGES)
    for chart in (errors, energies):
        bands = [one for one in chart.series if isinstance(one, Band)]
        assert [(band.left, band.right) for band in bands] == [(0.0, 1.0), (1.0, 3.0), (3.0, 3.5)]
        assert [band.label for band in bands] == ["hull", "fill", "hull"]
        assert bands[0].color == bands[2].color != bands[1].color
        assert chart.y.log
    points = [np.stack([c.x, c.y], 1).tolist() for c in drawn(energies)]
    assert points == [[[0.0, 1.0], [1.0, 0.1]], [[1.5, 50.0], [3.0, 40.0]], [[3.5, 0.01]]]
    (error,) = drawn(errors)
    assert error.x.tolist() == [0.0, 1.0, 3.0, 3.5]
    paper = energy_figure(STAGES)
    assert paper.texts[-2:] == ["hull", "fill"]
    assert is_whole(paper)


@pytest.mark.parametrize("error", [None, 0.0])
def test_without_errors_or_with_none_but_zeros_the_figure_is_drawn(error: float | None) -> None:
    paper = energy_figure([replace(step, max_abs_error=error) for step in STAGES])
    assert ("not known" if error is None else "0") in paper.texts
    assert is_whole(paper)


def test_many_steps_in_one_instant_are_drawn() -> None:
    steps = [Step(0, 0.0, 1.0, 0.1, stage="polish")] * 200
    assert drawn(energy_charts(steps)[1])[0].style.marker == ""
    assert is_whole(energy_figure(steps))


def test_an_empty_history_is_refused() -> None:
    for draw in (lambda: convergence_charts([], 0.1), lambda: energy_charts([])):
        with pytest.raises(InputError, match="at least one step"):
            draw()


def test_bars_tell_the_worst_deviation() -> None:
    chart = bars_chart(["a", "b"], [0.25, 0.75], [0.26, 0.74])
    assert "max |p − q| = 0.01" in chart.title
    assert "26.00" in [note.text for note in chart.notes]


def test_bars_before_and_after_have_one_for_all_other_rests() -> None:
    chart = before_after_chart(["a", "b"], [0.5, 0.5], [0.1, 0.7], [0.49, 0.5], (0.2, 0.01))
    target, before, after = (one for one in chart.series if isinstance(one, Bars))
    np.testing.assert_allclose(target.heights, [50, 50, 0])
    np.testing.assert_allclose(before.heights, [10, 70, 20])
    np.testing.assert_allclose(after.heights, [49, 50, 1])
    assert [text for _, text in chart.x.marks()] == ["a", "b", "elsewhere"]
    assert chart.title == "max |p − q| = 0.4 before, 0.01 after"


TARGET, GEOMETRIC, MOMENTUM = (0.25, 0.5, 0.25), (0.2, 0.5, 0.3), (0.24, 0.5, 0.26)
INTERVALS = ((0.2, 0.3), (0.45, 0.55), (0.2, 0.28))
SIMULATED = SimulatedThrows(
    "native", 1, 12345, 0, (26, 50, 24), (0.26, 0.5, 0.24), INTERVALS, 0.01, (0.0, 0.0256), 0.0123
)


def thrown(rounds: int, simulated: bool = True, **changes: Any) -> ThrownOdds:
    usual = {"elsewhere_drops": 0, "elsewhere": None, "asked": TARGET, "frequencies": TARGET}
    values = {**usual, **changes}
    made = (
        RoundOfThrows(1000, 0.1, 0.02, 0.09, is_kept=False, **values),
        RoundOfThrows(1500, 0.04, 0.016, 0.03, is_kept=True, **values),
    )
    return ThrownOdds({}, MOMENTUM, made[:rounds], SIMULATED if simulated else None)


def test_odds_on_the_table_by_each_model() -> None:
    chart = table_chart(["a", "b", "$c$"], TARGET, GEOMETRIC, thrown(0))
    bars = [one.heights for one in chart.series if isinstance(one, Bars)]
    np.testing.assert_allclose(
        bars, 100.0 * np.array([TARGET, GEOMETRIC, MOMENTUM, SIMULATED.frequencies])
    )
    (intervals,) = (one for one in chart.series if isinstance(one, Intervals))
    np.testing.assert_allclose(intervals.low, 100.0 * np.array(INTERVALS)[:, 0])
    assert chart.title == (
        "12,345 throws: total variation 0.0100 (95 %: 0.0000 to 0.0256), a perfect die: 0.0123"
    )
    assert is_whole(sheet([chart]))
    assert table_chart(["a", "b", "c"], TARGET, GEOMETRIC, thrown(0, False)).title == (
        "total variation to the target: without momentum 0.0500, momentum model 0.0100"
    )


@pytest.mark.parametrize("count", [1, 20, 60])
def test_few_and_many_outcomes_fit_on_the_sheet(count: int) -> None:
    odds = (1.0 / count,) * count
    simulated = replace(SIMULATED, frequencies=odds, intervals=((1.0 / count,) * 2,) * count)
    labels = [str(100 + i) for i in range(count)]
    chart = table_chart(labels, odds, odds, ThrownOdds({}, odds, (), simulated))
    assert is_whole(sheet([chart]))


def test_rounds_against_all_throws_so_far() -> None:
    chart = rounds_chart(thrown(2))
    drawn = curves(chart)
    np.testing.assert_allclose(drawn["its throws"], [[1000, 0.1], [2500, 0.04]])
    np.testing.assert_allclose(drawn["expected"], [[1000, 0.09], [2500, 0.03]])
    np.testing.assert_allclose(drawn["kept"], [[2500, 0.03]])
    np.testing.assert_allclose(
        drawn["a perfect die"], [[1000, 0.02], [2500, 0.016], [14845, 0.0123]]
    )
    (interval,) = (one for one in chart.series if isinstance(one, Intervals))
    assert (interval.low, interval.high) == ([0.0], [0.0256])
    assert chart.y.low == 0.0
    assert chart.y.high > 0.1
    assert is_whole(sheet([chart]))


def test_rounds_on_other_tables() -> None:
    chart = rounds_chart(thrown(2, elsewhere_drops=500, elsewhere=0.3))
    drawn = curves(chart)
    np.testing.assert_allclose(drawn["expected on nine of ten tables"], [[1500, 0.3], [3500, 0.3]])
    np.testing.assert_allclose(drawn["expected"], [[1500, 0.09], [3500, 0.03]])
    assert chart.y.high > 0.3
    assert is_whole(sheet([chart]))


def test_rounds_without_a_verdict() -> None:
    assert set(curves(rounds_chart(thrown(1, False)))) == {
        "its throws",
        "a perfect die",
        "expected",
        "kept",
    }
    with pytest.raises(InputError, match="rounds: expected at least one, got none"):
        rounds_chart(thrown(0))


def test_lines_beside_the_bars_hold_the_odds_of_prints() -> None:
    chart = bars_chart(["a", "b"], [0.25, 0.75], [0.26, 0.74], [0.01, 0.02])
    (lines,) = (one for one in chart.series if isinstance(one, Intervals))
    np.testing.assert_allclose(lines.high, 100.0 * np.array([0.26 + 0.0196, 0.74 + 0.0392]))
    np.testing.assert_allclose(lines.low, 100.0 * np.array([0.26 - 0.0196, 0.74 - 0.0392]))
    assert is_whole(sheet([chart]))
    chart = table_chart(["a", "b", "$c$"], TARGET, GEOMETRIC, thrown(0, False), [0.01] * 3)
    assert sum(isinstance(one, Intervals) for one in chart.series) == 1
