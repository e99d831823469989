"""Charts hold their values, read back from their axes, and nothing of them is cut off."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from common.drawings import curves, is_whole
from common.finished import CONCAVE, finished_box

from dicedesign.errors import InputError
from dicedesign.palette import ACCENT, FAINT
from dicedesign.report.bar_charts import (
    Bars,
    bars_chart,
    before_after_chart,
    intervals_of_prints,
    outcome_chart,
    rolls_chart,
    table_chart,
)
from dicedesign.report.curve_charts import course_chart, hands_chart, rounds_chart, trade_off_chart
from dicedesign.report.sheet import Sheet
from dicedesign.results.parts import (
    Draft,
    RoundOfThrows,
    Search,
    SimulatedThrows,
    TableResult,
    TradeOff,
)
from dicedesign.results.result import Step
from dicedesign.throws.goodness_of_fit import judge_rolls

TARGET, PROBABILITIES = [0.25, 0.5, 0.25], [0.2, 0.5, 0.3]
INTERVALS = [[0.15, 0.25], [0.45, 0.55], [0.24, 0.33]]


def heights(sheet: Sheet) -> dict[str, list[float]]:
    """Of bars, by their entry in the legend."""
    (axes,) = sheet.figure.axes
    return {
        bars.get_label(): [bar.get_height() for bar in bars]
        for bars in axes.containers
        if hasattr(bars, "patches")
    }


def limits(sheet: Sheet) -> list[np.ndarray]:
    """(k, 2) ends of each kind of intervals."""
    (axes,) = sheet.figure.axes
    ends = [c[2][0].get_segments() for c in axes.containers if not hasattr(c, "patches")]
    return [np.array(lines)[:, :, 1] for lines in ends]


def test_bars_beside_each_other_have_their_values() -> None:
    two = Bars("two", ACCENT, TARGET, INTERVALS, "range", ())
    kinds = [Bars("one", FAINT, PROBABILITIES), two]
    sheet = outcome_chart(["a", "b", "$c$"], kinds, title="title", x_label="x", target=TARGET)
    assert is_whole(sheet)
    drawn = heights(sheet)
    for name, values in (("target", TARGET), ("one", PROBABILITIES), ("two", TARGET)):
        np.testing.assert_allclose(drawn[name], 100.0 * np.array(values))
    np.testing.assert_allclose(limits(sheet)[0], 100.0 * np.array(INTERVALS))
    assert [text.get_text() for text in sheet.figure.axes[0].get_xticklabels()] == ["a", "b", "$c$"]
    assert {"20.00", "50.00", "30.00", "target", "range"} <= set(sheet.texts)


def test_counts_of_throws_with_their_intervals() -> None:
    verdict = judge_rolls([30, 50, 20], [0.25, 0.5, 0.25], 0.9)
    sheet = rolls_chart(["a", "b", "c"], verdict)
    drawn = heights(sheet)
    np.testing.assert_allclose(
        drawn["probabilities tested"] + drawn["thrown"], [25, 50, 25, 30, 50, 20]
    )
    np.testing.assert_allclose(limits(sheet)[0], 100 * verdict.intervals)
    assert {"30", "50", "20", "exact 90 % interval"} <= set(sheet.texts)
    with pytest.raises(InputError, match=r"one probability of each kind each, got 1 labels and 3"):
        rolls_chart(["a"], verdict)


def test_bars_of_prints_hold_95_percent_of_them() -> None:
    probabilities_of_prints = np.random.default_rng(0).normal(
        PROBABILITIES, [0.01, 0.02, 0.03], size=(100_000, 3)
    )
    ends = intervals_of_prints(PROBABILITIES, [0.01, 0.02, 0.03])
    within = (probabilities_of_prints > ends[:, 0]) & (probabilities_of_prints < ends[:, 1])
    np.testing.assert_allclose(within.mean(axis=0), 0.95, atol=0.005)
    # Probabilities are none below 0.
    wide = intervals_of_prints(PROBABILITIES, [0.5, 0.0, 0.0])
    np.testing.assert_allclose(wide, [[0.0, 1.0], [0.5, 0.5], [0.3, 0.3]])


SIMULATED = SimulatedThrows(
    "native",
    1,
    12345,
    0,
    (26, 50, 24),
    (0.26, 0.5, 0.24),
    ((0.2, 0.3), (0.45, 0.55), (0.2, 0.28)),
    0.01,
    (0.0, 0.0256),
    0.0123,
)


def table_result(rounds: int, simulated: bool = True, **changes: Any) -> TableResult:
    usual = {"requested": TARGET, "frequencies": TARGET}
    values = {**usual, **changes}
    all_rounds = (
        RoundOfThrows(1000, 0.1, 0.02, 0.09, is_kept=False, **values),
        RoundOfThrows(1500, 0.04, 0.016, 0.03, is_kept=True, **values),
    )
    probabilities = (0.24, 0.5, 0.26)
    return TableResult({}, probabilities, all_rounds[:rounds], SIMULATED if simulated else None)


def test_dice_and_their_targets() -> None:
    die = finished_box(labels=("a", "b", "c"), target=TARGET, probabilities=PROBABILITIES)
    sheet = bars_chart(die)
    np.testing.assert_allclose(heights(sheet)["achieved"], 100.0 * np.array(PROBABILITIES))
    table = replace(die, result=replace(die.result, thrown=table_result(0)))
    drawn = heights(table_chart(table))
    np.testing.assert_allclose(drawn["target"], 100.0 * np.array(TARGET))
    np.testing.assert_allclose(drawn["without momentum"], 100.0 * np.array(PROBABILITIES))
    np.testing.assert_allclose(drawn["momentum model"], [24, 50, 26])
    np.testing.assert_allclose(drawn["simulated throws"], [26, 50, 24])
    table = replace(die, result=replace(die.result, thrown=table_result(0, False)))
    assert "simulated throws" not in heights(table_chart(table))


def test_bars_before_and_after_have_one_for_all_other_rests() -> None:
    concave = replace(CONCAVE, probabilities_before=(0.1, 0.7), elsewhere_before=0.2)
    after = {"probabilities": (0.49, 0.5), "elsewhere": 0.01, "concave": concave}
    die = finished_box(labels=("a", "b"), target=(0.5, 0.5), **after)
    sheet = before_after_chart(die)
    drawn = heights(sheet)
    np.testing.assert_allclose(drawn["target"], [50, 50, 0])
    np.testing.assert_allclose(drawn["before"], [10, 70, 20])
    np.testing.assert_allclose(drawn["after"], [49, 50, 1])


def history(count: int) -> list[Step]:
    return [
        Step(k, 0.1 * k, 2.0 * 0.99**k, 0.2 * 0.98**k, {"dice": 2.0 * 0.99**k})
        for k in range(count)
    ]


def course_of(steps: list[Step], tolerance: float) -> Sheet:
    return course_chart(replace(finished_box(history=tuple(steps)), tolerance=tolerance))


def course(sheet: Sheet, column: int) -> list[np.ndarray]:
    """Points of the curves of a chart, without levels."""
    lines = sheet.figure.axes[column].lines
    return [np.asarray(one.get_xydata()) for one in lines if one.get_linestyle() != "--"]


@pytest.mark.parametrize("count", [1, 1000])
def test_error_and_energy_over_time(count: int) -> None:
    steps = history(count)
    sheet = course_of(steps, 1e-3)
    (errors,), (energies,) = course(sheet, 0), course(sheet, 1)
    np.testing.assert_allclose(errors, [(s.seconds, s.max_abs_error) for s in steps])
    np.testing.assert_allclose(energies, [(s.seconds, s.energy) for s in steps])
    assert "tolerance 0.001" in sheet.texts
    assert is_whole(sheet)
    clockless = course_of([replace(step, seconds=None) for step in steps], 1e-3)
    np.testing.assert_allclose(course(clockless, 0)[0][:, 0], range(count))
    assert not any("time" in text for text in clockless.texts)


def test_the_energy_of_preferences_is_drawn_from_their_first_step() -> None:
    steps = history(20)
    steps[12:] = [replace(step, terms={"preferences": 1.0}) for step in steps[12:]]
    sheet = course_of(steps, 1e-3)
    assert len(course(sheet, 0)[0]) == 20
    assert course(sheet, 1)[0][:, 1].tolist() == [step.energy for step in steps[12:]]


STAGES = [
    Step(0, 0.0, 1.0, 0.3, stage="hull"),
    Step(1, 1.0, 0.1, 0.01, stage="hull"),
    Step(2, 1.5, 50.0, None, stage="fill"),
    Step(3, 3.0, 40.0, 0.02, stage="fill"),
    Step(4, 3.5, 0.01, 0.001, stage="hull"),
]


def test_each_stage_has_its_stretch_and_its_curve() -> None:
    sheet = course_of(STAGES, 1e-4)
    for axes in sheet.figure.axes:
        spans = [(b.get_x(), b.get_x() + b.get_width(), b.get_label()) for b in axes.patches]
        assert spans == [(0.0, 1.0, "hull"), (1.0, 3.0, "fill"), (3.0, 3.5, "hull")]
    energies = [part.tolist() for part in course(sheet, 1)]
    assert energies == [[[0.0, 1.0], [1.0, 0.1]], [[1.5, 50.0], [3.0, 40.0]], [[3.5, 0.01]]]
    assert course(sheet, 0)[0][:, 0].tolist() == [0.0, 1.0, 3.0, 3.5]
    assert is_whole(sheet)
    unknown = course_of([replace(step, max_abs_error=None) for step in STAGES], 1e-4)
    assert "not known" in unknown.texts


def test_rounds_against_all_throws_so_far() -> None:
    sheet = rounds_chart(finished_box(thrown=table_result(2)))
    drawn = curves(sheet.figure.axes[0])
    np.testing.assert_allclose(drawn["its throws"], [[1000, 0.1], [2500, 0.04]])
    np.testing.assert_allclose(drawn["expected"], [[1000, 0.09], [2500, 0.03]])
    np.testing.assert_allclose(drawn["kept"], [[2500, 0.03]])
    np.testing.assert_allclose(
        drawn["a perfect die"], [[1000, 0.02], [2500, 0.016], [14845, 0.0123]]
    )
    np.testing.assert_allclose(limits(sheet)[0], [(0.0, 0.0256)])
    assert is_whole(sheet)


def test_hands_against_the_energy_of_their_throws() -> None:
    energies, shares = [2.0, 5.0, 20.0, 30.0], np.linspace(0.1, 0.4, 4)
    tables = [SimpleNamespace(energy=energy) for energy in energies]
    each: Any = SimpleNamespace(die=SimpleNamespace(tables=tables))
    probabilities = np.stack([shares, 1.0 - shares], axis=1)
    by_table: Any = SimpleNamespace(probabilities=probabilities, often=0.1, worst=0.2)
    thrown = replace(table_result(0), by_table=by_table)
    die = finished_box(labels=("a", "b"), target=(0.25, 0.75), thrown=thrown)
    sheet = hands_chart(replace(die, thrown=each))
    drawn = curves(sheet.figure.axes[0])
    for label, values in zip("ab", 100.0 * probabilities.T, strict=True):
        np.testing.assert_allclose(drawn[label], np.stack([energies, values], axis=1))
    levels = [line.get_ydata()[0] for line in sheet.figure.axes[0].lines[2::3]]
    assert levels == [25.0, 75.0]
    assert is_whole(sheet)


GOOD = Draft(3, 1.0, 1e-4, 0.02, 60.0, 15.0, 0)
DRAFTS = (
    GOOD,
    Draft(4, 1.0, 0.0, 0.05, 60.0, 15.0, 0),
    Draft(6, 1.0, 0.3, 0.01, 10.0, 1.0, 8),
    Draft(7, 1.0, 1e-3, 0.03, 60.0, 15.0, 2),
    Draft(8, 1.0, 1e-3, 0.04, 20.0, 15.0, 0),
    Draft(9, 1.0, 1e-3, 0.06, 60.0, 2.0, 0),
)


def trade_off(drafts: tuple[Draft, ...], attempt: int | None, elsewhere: float) -> Sheet:
    """Chart of a search; the original surface has an error of `elsewhere`."""
    concave = replace(CONCAVE, probabilities_before=(1 / 6,) * 6, elsewhere_before=elsewhere)
    search = Search(9, None, attempt, TradeOff(0.005, 45.0, 10.0, 0.03, drafts))
    return trade_off_chart(finished_box(concave=concave, search=search))


def test_every_draft_is_drawn_once_by_its_worst_flaw() -> None:
    sheet = trade_off(DRAFTS, 7, 0.42)
    (axes,) = sheet.figure.axes
    drawn = {label: points for label, points in curves(axes).items() if label.endswith(")")}
    assert [int(label.rsplit("(", 1)[1][:-1]) for label in drawn] == [2, 1, 1, 1, 1]
    zero = axes.get_ylim()[0]
    expected = [(100.0 * d.displacement, d.error or zero) for d in DRAFTS]
    np.testing.assert_allclose(
        sorted(np.concatenate(list(drawn.values())).tolist()), sorted(expected)
    )
    np.testing.assert_allclose(curves(axes)["this die"], [(3.0, 1e-3)])
    np.testing.assert_allclose(curves(axes)["the original surface"], [(0.0, 0.42)])
    assert {"3", "4", "6", "7", "8", "9"} <= set(sheet.texts)
    assert is_whole(sheet)


def test_an_unfinished_search_is_drawn() -> None:
    for drafts in ((), (Draft(1, None, 0.0, 0.0, 0.0, 0.0, 0),)):
        assert is_whole(trade_off(drafts, None, 0.0))
