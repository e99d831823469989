"""The bench of what is left out: its rows, its ways of measuring, and the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dicedesign.bench import lean
from dicedesign.bench.lean import run_lean
from dicedesign.bench.measures import processes as stopwatch
from dicedesign.bench.measures.feature_costs import Row, time_row
from dicedesign.bench.measures.processes import in_new_process, in_turn
from dicedesign.cli.main import main

FEATURES = (
    "torch, which a query never loads",
    "figure of a query",
    "engraving",
    "coplanar term",
    "barycenter term",
    "neighbor term",
    "stability term",
    "center of mass of the uniform solid",
    "gradient, for accepted steps only",
    "Sobolev step, its factor kept",
    "Sobolev factor made anew",
    "hull rebuilt though its edges last",
    "exact arithmetic, for what rounding leaves open",
)


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return list(run_lean(processes=1, seconds=0.0))


def test_every_feature_has_its_rows_in_order(rows: list[Row]) -> None:
    assert list(dict.fromkeys(row.feature for row in rows)) == list(FEATURES)
    assert len({(row.feature, row.quantity) for row in rows}) == len(rows)


def test_every_cost_is_a_number(rows: list[Row]) -> None:
    for row in rows:
        assert row.unit in ("s", "MB", "ms", "µs", "calls")
        assert np.isfinite([row.without, row.included]).all()
        assert row.included > 0.0
        assert row.without > 0.0 or row.unit == "calls"


def test_what_does_not_depend_on_the_machine_s_load(rows: list[Row]) -> None:
    found = {(row.feature, row.unit): row for row in rows}
    torch, figure = found[FEATURES[0], "MB"], found["figure of a query", "MB"]
    assert torch.included > torch.without + 50.0
    assert figure.included > figure.without + 20.0
    assert torch.without == figure.without < 150.0
    exact = found[FEATURES[-1], "calls"]
    assert exact.without == 0.0
    assert exact.ratio is None
    assert exact.included >= 4.0  # one for each side
    kept = [row.quantity for row in rows if row.feature == "hull rebuilt though its edges last"]
    assert len(kept) == 2
    assert not any("edges last in 0 %" in quantity for quantity in kept)


def test_times_are_medians_of_works_done_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    clock = [0.0]
    monkeypatch.setattr(stopwatch.time, "process_time", lambda: clock[0])

    def busy(name: str, seconds: float) -> None:
        order.append(name)
        # The first, which is not counted, and one other take much longer.
        clock[0] += seconds if len(order) not in (1, 5) else 0.02

    short, long = in_turn([lambda: busy("a", 1e-3), lambda: busy("b", 4e-3)], 0.06)
    rounds = ["".join(order[i : i + 2]) for i in range(0, len(order), 2)]
    assert len(rounds) >= 6
    assert set(rounds) == {"ab", "ba"}
    assert (short, long) == (pytest.approx(1e-3), pytest.approx(4e-3))


def test_a_new_process_starts_without_what_this_one_holds(tmp_path: Path) -> None:
    (tmp_path / "size").write_text("100_000_000")
    block = "block = bytearray(b'x' * 1) * int(open('size').read().replace('_', ''))"
    (_, least), (seconds, most) = in_new_process([("", "pass"), ("", block)], tmp_path, 1)
    assert seconds > 0.0
    if least is None or most is None:
        pytest.skip("this system does not tell the peak of memory")
    assert least < 50.0
    assert most - least == pytest.approx(100.0, abs=5.0)


def test_a_work_that_fails_says_why(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"one = 1\none / 0\n(.|\n)*ZeroDivisionError"):
        in_new_process([("one = 1", "one / 0")], tmp_path, 1)


@pytest.mark.parametrize(
    ("seconds", "unit", "value"), [(2e-3, "ms", 2.0), (2e-5, "µs", 20.0), (1.5, "ms", 1500.0)]
)
def test_times_get_a_unit_that_suits_them(seconds: float, unit: str, value: float) -> None:
    row = time_row("this", "that", seconds, 3.0 * seconds)
    assert (row.unit, row.without) == (unit, pytest.approx(value))
    assert row.ratio == pytest.approx(3.0)


def test_the_command_prints_a_table_or_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    costs = [
        Row("engraving", "peak memory", "MB", 200.0, 250.0),
        Row("exact arithmetic", "decisions", "calls", 0.0, 64.0),
    ]
    monkeypatch.setattr(lean, "run_lean", lambda **options: iter(costs))
    assert main(["bench", "lean"]) == 0
    table = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert table == [
        ["feature", "measured", "without", "with", "ratio"],
        ["engraving", "peak", "memory", "200", "250", "MB", "1.25"],
        ["exact", "arithmetic", "decisions", "0", "64", "calls", "-"],
    ]
    assert main(["bench", "lean", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert {"date", "machine", "python", "dicedesign", "torch"} <= set(record)
    given = record["rows"]
    assert given[0] == {
        "feature": "engraving",
        "measured": "peak memory",
        "unit": "MB",
        "without": 200.0,
        "with": 250.0,
        "ratio": 1.25,
    }
    assert given[1]["ratio"] is None
