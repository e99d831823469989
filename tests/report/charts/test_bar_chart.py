"""Bars of odds and of frequencies."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from common.drawings import is_whole
from PIL import Image

from dicedesign.errors import InputError
from dicedesign.report.charts.bar_chart import OddsBars, odds_chart
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.palette import ACCENT, FAINT, PALE
from dicedesign.report.charts.rolls import rolls_chart
from dicedesign.report.charts.series import Bars, Intervals, Levels
from dicedesign.throws.roll_verdict import judge_rolls

TARGET, ODDS = [0.25, 0.5, 0.25], [0.2, 0.5, 0.3]
INTERVALS = [[0.15, 0.25], [0.45, 0.55], [0.28, 0.33]]


def of_kind(chart: Chart, kind: type) -> list:
    return [one for one in chart.series if isinstance(one, kind)]


@pytest.mark.parametrize("number", [1, 4, 6])
def test_a_title_is_whole_above_any_number_of_kinds(number: int) -> None:
    """Blank paper is above the title, however many rows the legend has."""
    kinds = [OddsBars(f"kind number {i}", FAINT, ODDS, INTERVALS, f"{i}") for i in range(number)]
    paper = sheet([odds_chart(["a", "b", "c"], kinds, title="TITLE", x_label="outcome")])
    pixels = np.asarray(Image.open(BytesIO(paper.png())).convert("L"))
    assert (pixels[:4] > 250).all()
    assert (pixels[4:60] < 128).any()


def test_bars_stand_beside_each_other_in_front_of_the_target() -> None:
    kinds = [
        OddsBars.written("one", FAINT, ODDS),
        OddsBars("two", ACCENT, TARGET, INTERVALS, "range"),
    ]
    chart = odds_chart(["a", "b", "$c$"], kinds, title="title", x_label="outcome", target=TARGET)
    target, one, two = of_kind(chart, Bars)
    np.testing.assert_allclose(target.heights, 100.0 * np.array(TARGET))
    np.testing.assert_allclose(one.heights, 100.0 * np.array(ODDS))
    np.testing.assert_allclose(one.x + one.width / 2, two.x - two.width / 2)
    assert (one.x - one.width / 2 > target.x - target.width / 2).all()
    assert (two.x + two.width / 2 < target.x + target.width / 2).all()
    (marks,), (intervals,) = of_kind(chart, Levels), of_kind(chart, Intervals)
    np.testing.assert_allclose(marks.y, target.heights)
    np.testing.assert_allclose(intervals.x, two.x)
    np.testing.assert_allclose(
        np.stack([intervals.low, intervals.high], 1), 100 * np.array(INTERVALS)
    )
    assert [text for _, text in chart.x.marks()] == ["a", "b", "$c$"]
    assert [note.text for note in chart.notes] == ["20.00", "50.00", "30.00"]
    paper = sheet([chart])
    assert {"title", "outcome", "probability (%)", "target", "one", "two", "range"} <= set(
        paper.texts
    )
    assert is_whole(paper)


@pytest.mark.parametrize(("count", "values"), [(1, 1), (16, 16), (17, 0), (60, 0)])
def test_values_are_written_for_few_outcomes(count: int, values: int) -> None:
    odds = np.full(count, 1.0 / count)
    labels = [f"no. {k}" for k in range(count)]
    chart = odds_chart(labels, [OddsBars.written("p", PALE, odds)], title="", x_label="")
    assert len(chart.notes) == values
    assert is_whole(sheet([chart]))
    # Bars and what is written above them stay below the upper end.
    assert chart.y.high > 100.0 / count


@pytest.mark.parametrize("labels", [[], ["a", "b"]])
def test_one_of_each_for_each_outcome(labels: list[str]) -> None:
    kinds = [OddsBars("p", PALE, ODDS)]
    with pytest.raises(InputError, match=rf"got {len(labels)} labels and 3, 3 probabilities"):
        odds_chart(labels, kinds, title="", x_label="", target=TARGET)


def test_counts_of_throws_stand_above_their_intervals() -> None:
    verdict = judge_rolls([30, 50, 20], [0.25, 0.5, 0.25], 0.9)
    chart = rolls_chart(["a", "b", "c"], verdict)
    tested, thrown = of_kind(chart, Bars)
    np.testing.assert_allclose([*tested.heights, *thrown.heights], [25, 50, 25, 30, 50, 20])
    (intervals,) = of_kind(chart, Intervals)
    np.testing.assert_allclose(intervals.high, 100 * verdict.intervals[:, 1])
    assert [note.text for note in chart.notes] == ["30", "50", "20"]
    np.testing.assert_allclose([note.y for note in chart.notes], intervals.high)
    assert chart.title.startswith("100 throws: p = 0.37, total variation 0.050 (a perfect die")
    assert intervals.label == "exact 90 % interval"
    with pytest.raises(InputError, match=r"rolls: expected 3 labels, one for each outcome, got 1"):
        rolls_chart(["a"], verdict)


def test_bars_of_prints_hold_95_percent_of_them() -> None:
    bars = OddsBars.written("die", ACCENT, ODDS)
    assert bars.of_prints(None) is bars
    odds_of_prints = np.random.default_rng(0).normal(ODDS, [0.01, 0.02, 0.03], size=(100_000, 3))
    limits = np.asarray(bars.of_prints([0.01, 0.02, 0.03]).intervals)
    within = (odds_of_prints > limits[:, 0]) & (odds_of_prints < limits[:, 1])
    np.testing.assert_allclose(within.mean(axis=0), 0.95, atol=0.005)
    # Odds are none below 0.
    wide = np.asarray(bars.of_prints([0.5, 0.0, 0.0]).intervals)
    np.testing.assert_allclose(wide, [[0.0, 1.0], [0.5, 0.5], [0.3, 0.3]])
