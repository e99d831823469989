"""The bench of prints that are a little off: its rows and the command."""

from __future__ import annotations

import json

import pytest

from dicedesign.bench.benches.tolerance import AnswerRow, Extent, PreferenceRow, SpreadRow
from dicedesign.bench.frame import BENCHES, Run
from dicedesign.cli.main import main


@pytest.fixture(scope="module")
def rows() -> list[object]:
    return list(BENCHES["tolerance"].rows(Run(Extent(dice=1, prints=60))))


def test_each_error_is_predicted_and_printed(rows: list[object]) -> None:
    spreads = [row for row in rows if isinstance(row, SpreadRow)]
    assert len({row.error for row in spreads}) == 5
    for row in spreads:
        assert row.ratio == pytest.approx(row.measured / row.predicted)
        # 60 prints of several outcomes: a standard error of at most 0.09.
        assert row.ratio == pytest.approx(1.0, abs=0.35)
        assert row.lost == 0
    alone = sum(row.predicted**2 for row in spreads if row.error != "all")
    (together,) = (row for row in spreads if row.error == "all")
    assert together.predicted**2 == pytest.approx(alone)


def test_prints_as_bad_as_is_allowed_are_noticed_as_often(rows: list[object]) -> None:
    (row,) = (row for row in rows if isinstance(row, AnswerRow))
    assert row.predicted == pytest.approx(0.1, abs=1e-4)
    assert 0.04 < row.noticed < 0.2


def test_the_preference_lets_prints_be_worse(rows: list[object]) -> None:
    found = {row.prefer: row for row in rows if isinstance(row, PreferenceRow)}
    nothing = found["nothing"]
    # Descent may end in one valley or another.
    for name in ("tolerance", "legible, tolerance: 1"):
        assert found[name].predicted < 0.85 * nothing.predicted
        assert found[name].measured < 0.85 * nothing.measured
        assert found[name].allowed > 1.2 * nothing.allowed


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "tolerance", "--quick", "--prints", "20", "--json"]) in (0, 1)
    record = json.loads(capsys.readouterr().out)
    assert {"rows", "answers", "preferences"} <= set(record)
    assert record["prints"] == 20
