"""Charts hold their values, read back from their axes, and nothing of them is cut off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from common.drawings import curves, is_whole, words
from common.finished import CONCAVE, finished_box
from matplotlib.colors import to_hex

from dicedesign.errors import InputError
from dicedesign.palette import BLANK, outcome_colors
from dicedesign.report.bar_charts import (
    Bars,
    intervals_of_prints,
    outcome_chart,
    probabilities,
    reshaped_probabilities,
    roll_frequencies,
    table_probabilities,
)
from dicedesign.report.curve_charts import hands, history, rounds, trade_off
from dicedesign.report.figures import FIGURES
from dicedesign.report.sheet import Sheet
from dicedesign.results.parts import (
    Draft,
    RoundOfThrows,
    Search,
    SimulatedThrows,
    TableResult,
    TradeOff,
)
from dicedesign.results.result import Result, Step
from dicedesign.throws.goodness_of_fit import judge_rolls

TARGET, PROBABILITIES = [0.25, 0.5, 0.25], [0.2, 0.5, 0.3]
INTERVALS = [[0.15, 0.25], [0.45, 0.55], [0.24, 0.33]]


def heights(sheet: Sheet) -> dict[str, list[float]]:
    """Of bars, by their entry in the legend."""
    (axes,) = sheet.axes
    return {
        bars.get_label(): [bar.get_height() for bar in bars]
        for bars in axes.containers
        if hasattr(bars, "patches")
    }


def limits(sheet: Sheet) -> list[np.ndarray]:
    """(k, 2) ends of each kind of intervals."""
    (axes,) = sheet.axes
    ends = [c[2][0].get_segments() for c in axes.containers if not hasattr(c, "patches")]
    return [np.array(lines)[:, :, 1] for lines in ends]


def test_bars_with_intervals_have_their_values() -> None:
    two = Bars("two", TARGET, INTERVALS, "range", ())
    series = [Bars("one", PROBABILITIES), two]
    sheet = outcome_chart(["a", "b", "$c$"], series, title="title", x_label="x", target=TARGET)
    assert is_whole(sheet)
    drawn = heights(sheet)
    for name, values in (("target", TARGET), ("one", PROBABILITIES), ("two", TARGET)):
        np.testing.assert_allclose(drawn[name], 100.0 * np.array(values))
    np.testing.assert_allclose(limits(sheet)[0], 100.0 * np.array(INTERVALS))
    assert [text.get_text() for text in sheet.axes[0].get_xticklabels()] == ["a", "b", "$c$"]
    verdict = judge_rolls([30, 50, 20], [0.25, 0.5, 0.25], 0.9)
    sheet = roll_frequencies(["a", "b", "c"], verdict)
    drawn = heights(sheet)
    np.testing.assert_allclose(drawn["probabilities tested"], [25, 50, 25])
    np.testing.assert_allclose(drawn["thrown"], [30, 50, 20])
    np.testing.assert_allclose(limits(sheet)[0], 100 * verdict.intervals)
    with pytest.raises(InputError, match="1 labels and 3"):
        roll_frequencies(["a"], verdict)


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


def table_result(rounds: int) -> TableResult:
    targets = {"requested": TARGET, "frequencies": TARGET}
    all_rounds = (
        RoundOfThrows(1000, 0.1, 0.02, 0.09, is_kept=False, **targets),
        RoundOfThrows(1500, 0.04, 0.016, 0.03, is_kept=True, **targets),
    )
    return TableResult({}, (0.24, 0.5, 0.26), all_rounds[:rounds], SIMULATED)


BEFORE_AFTER = {
    "labels": ("a", "b"),
    "target": (0.5, 0.5),
    "probabilities": (0.49, 0.5),
    "elsewhere": 0.01,
    "concave": replace(CONCAVE, probabilities_before=(0.1, 0.7), elsewhere_before=0.2),
}


@pytest.mark.parametrize(
    ("chart", "changes", "expected"),
    [
        (probabilities, {}, {"achieved": [20, 50, 30]}),
        (
            table_probabilities,
            {"thrown": table_result(0)},
            {
                "target": [25, 50, 25],
                "without momentum": [20, 50, 30],
                "momentum model": [24, 50, 26],
                "simulated throws": [26, 50, 24],
            },
        ),
        (
            reshaped_probabilities,
            BEFORE_AFTER,
            {"target": [50, 50, 0], "before": [10, 70, 20], "after": [49, 50, 1]},
        ),
    ],
)
def test_bars_of_a_die_have_its_values(
    chart: Callable[[Result], Sheet],
    changes: dict[str, Any],
    expected: dict[str, list[float]],
) -> None:
    """Before and after a reshaping, one bar is for all other rests."""
    usual = {"labels": ("a", "b", "c"), "target": TARGET, "probabilities": PROBABILITIES}
    drawn = heights(chart(finished_box(**{**usual, **changes}).result))
    for name, values in expected.items():
        np.testing.assert_allclose(drawn[name], values)


@pytest.mark.parametrize("count", [3, 11])
def test_bars_have_the_colors_of_their_outcomes(count: int) -> None:
    """Of all series the last; probabilities of no outcome have another color."""

    def last_colors(sheet: Sheet) -> list[str]:
        return [to_hex(bar.get_facecolor()) for bar in sheet.axes[0].containers[-1]]

    labels, even = tuple(map(str, range(count))), (1.0 / count,) * count
    die = finished_box(labels=labels, target=even, probabilities=even)
    colors = [color.lower() for color in outcome_colors(count)]
    assert last_colors(probabilities(die.result)) == colors
    concave = replace(CONCAVE, probabilities_before=even)
    sheet = reshaped_probabilities(replace(die.result, concave=concave))
    assert last_colors(sheet) == [*colors, BLANK]


@pytest.mark.parametrize(
    "chart",
    [reshaped_probabilities, table_probabilities, rounds, trade_off],
)
def test_results_without_what_a_chart_shows_are_refused(chart: Callable[[Result], Sheet]) -> None:
    with pytest.raises(InputError, match="a < box: expected"):
        chart(finished_box().result)


STAGES = [
    Step(0, 0.0, 1.0, 0.3, stage="hull"),
    Step(1, 1.0, 0.1, 0.01, stage="hull"),
    Step(2, 1.5, 50.0, None, stage="fill"),
    Step(3, 3.0, 40.0, 0.02, stage="fill"),
    Step(4, 3.5, 0.01, 0.001, stage="hull"),
]


def course_of(first: int = 0, **changes: Any) -> tuple[list[list[float]], list[list[list[float]]]]:
    """Drawn errors and energies of the stages, without levels. changes: of steps from one on."""
    steps = [*STAGES[:first], *(replace(step, **changes) for step in STAGES[first:])]
    sheet = history(finished_box(history=tuple(steps)).result, 1e-4)
    assert is_whole(sheet)
    stages = [patch.get_label() for patch in sheet.axes[0].patches]
    assert stages == ["hull", "fill", "hull"][min(first, 1) :]
    errors, energies = (
        [line.get_xydata().tolist() for line in axes.lines if line.get_linestyle() != "--"]
        for axes in sheet.axes
    )
    return errors, energies


def test_error_and_energy_over_time() -> None:
    """Each stage has its own curve of the energy."""
    (errors,), energies = course_of()
    assert errors == [[0.0, 0.3], [1.0, 0.01], [3.0, 0.02], [3.5, 0.001]]
    assert energies == [[[0.0, 1.0], [1.0, 0.1]], [[1.5, 50.0], [3.0, 40.0]], [[3.5, 0.01]]]
    (errors,), _ = course_of(seconds=None)
    assert [number for number, _ in errors] == [0, 1, 3, 4]
    course_of(max_abs_error=None)
    # The energy of preferences is drawn from their first step on.
    _, energies = course_of(3, terms={"preferences": 1.0})
    assert energies == [[[3.0, 40.0]], [[3.5, 0.01]]]


def test_rounds_against_all_throws_so_far() -> None:
    sheet = rounds(finished_box(thrown=table_result(2)).result)
    drawn = curves(sheet.axes[0])
    np.testing.assert_allclose(drawn["its throws"], [[1000, 0.1], [2500, 0.04]])
    np.testing.assert_allclose(drawn["expected"], [[1000, 0.09], [2500, 0.03]])
    np.testing.assert_allclose(drawn["kept"], [[2500, 0.03]])
    np.testing.assert_allclose(
        drawn["a perfect die"], [[1000, 0.02], [2500, 0.016], [14845, 0.0123]]
    )
    assert is_whole(sheet)
    # Each die that was thrown in rounds has the figure.
    dice = [finished_box(thrown=table_result(number)) for number in range(3)]
    assert [FIGURES["rounds"].wanted(die) for die in dice] == [False, True, True]
    assert is_whole(rounds(dice[1].result))


def test_hands_against_the_energy_of_their_throws() -> None:
    energies, shares = [2.0, 5.0, 20.0, 30.0], np.linspace(0.1, 0.4, 4)
    tables = [SimpleNamespace(energy=energy) for energy in energies]
    each: Any = SimpleNamespace(die=SimpleNamespace(tables=tables))
    probabilities = np.stack([shares, 1.0 - shares], axis=1)
    by_table: Any = SimpleNamespace(probabilities=probabilities, often=0.1, worst=0.2)
    thrown = replace(table_result(0), by_table=by_table)
    die = finished_box(labels=("a", "b"), target=(0.25, 0.75), thrown=thrown)
    sheet = hands(replace(die, thrown=each))
    drawn = curves(sheet.axes[0])
    for label, values in zip("ab", 100.0 * probabilities.T, strict=True):
        np.testing.assert_allclose(drawn[label], np.stack([energies, values], axis=1))
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


def draw_drafts(drafts: tuple[Draft, ...], attempt: int | None, elsewhere: float) -> Sheet:
    """Chart of a search; the original surface has an error of `elsewhere`."""
    concave = replace(CONCAVE, probabilities_before=(1 / 6,) * 6, elsewhere_before=elsewhere)
    search = Search(9, None, attempt, TradeOff(0.005, 45.0, 10.0, 0.03, drafts))
    return trade_off(finished_box(concave=concave, search=search).result)


def test_every_draft_is_drawn_once_by_its_worst_flaw() -> None:
    sheet = draw_drafts(DRAFTS, 7, 0.42)
    (axes,) = sheet.axes
    drawn = {label: points for label, points in curves(axes).items() if label.endswith(")")}
    assert [int(label.rsplit("(", 1)[1][:-1]) for label in drawn] == [2, 1, 1, 1, 1]
    zero = axes.get_ylim()[0]
    expected = sorted((100.0 * d.displacement, d.error or zero) for d in DRAFTS)
    np.testing.assert_allclose(sorted(np.concatenate(list(drawn.values())).tolist()), expected)
    np.testing.assert_allclose(curves(axes)["this die"], [(3.0, 1e-3)])
    np.testing.assert_allclose(curves(axes)["the original surface"], [(0.0, 0.42)])
    assert {"3", "4", "6", "7", "8", "9"} <= set(words(sheet))
    assert is_whole(sheet)
    # An unfinished search.
    for drafts in ((), (Draft(1, None, 0.0, 0.0, 0.0, 0.0, 0),)):
        assert is_whole(draw_drafts(drafts, None, 0.0))
