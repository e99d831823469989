"""The bench of what is left out: its rows, its ways of measuring, and the command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dicedesign.bench.frame import BENCHES, Run
from dicedesign.bench.measures.designs.feature_costs import CostRow, time_row
from dicedesign.bench.measures.processes import in_new_process
from dicedesign.kernels import ops

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
    *(("torch around kernels",) if ops.available() else ()),
    "exact arithmetic, for what rounding leaves open",
)


@pytest.fixture(scope="module")
def rows() -> list[CostRow]:
    bench = BENCHES["lean"]
    return list(bench.rows(Run(bench.quick)))


def test_every_feature_has_its_rows_in_order(rows: list[CostRow]) -> None:
    assert list(dict.fromkeys(row.feature for row in rows)) == list(FEATURES)
    assert len({(row.feature, row.measured) for row in rows}) == len(rows)


def test_every_cost_is_a_number(rows: list[CostRow]) -> None:
    for row in rows:
        assert row.unit in ("s", "MB", "ms", "µs", "calls")
        assert np.isfinite([row.without, row.included]).all()
        assert row.included > 0.0
        assert row.without > 0.0 or row.unit == "calls"


def test_what_does_not_depend_on_the_machine_s_load(rows: list[CostRow]) -> None:
    found = {(row.feature, row.unit): row for row in rows}
    torch, figure = found[FEATURES[0], "MB"], found["figure of a query", "MB"]
    assert torch.included > torch.without + 50.0
    assert figure.included > figure.without + 20.0
    assert torch.without == figure.without < 150.0
    exact = found[FEATURES[-1], "calls"]
    assert exact.without == 0.0
    assert exact.ratio is None
    assert exact.included >= 4.0  # one for each side
    kept = [row.measured for row in rows if row.feature == "hull rebuilt though its edges last"]
    assert len(kept) == 2
    assert not any("edges last in 0 %" in measured for measured in kept)


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


def test_a_row_says_what_is_left_out() -> None:
    row = CostRow("exact arithmetic", "decisions", 0.0, 64.0, "calls")
    assert row.line().split() == ["exact", "arithmetic", "decisions", "0", "64", "calls", "-"]
    assert row.ratio is None
