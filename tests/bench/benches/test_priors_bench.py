"""The bench of priors: its rows and the command."""

from __future__ import annotations

import json

import pytest

from dicedesign.bench.benches.priors import CLOSE, DesignRow, Extent, OddsRow
from dicedesign.bench.frame import BENCHES, Run
from dicedesign.cli.main import main


def test_two_ways_agree_and_dice_are_found() -> None:
    rows = list(BENCHES["priors"].rows(Run(Extent(bodies=2, targets=1, seeds=1))))
    odds = [row for row in rows if isinstance(row, OddsRow)]
    assert {row.against for row in odds} == {"cubature", "complement"}
    for row in odds:
        assert row.bodies == 2
        assert row.off < CLOSE
        assert row.told < CLOSE
    designs = [row for row in rows if isinstance(row, DesignRow)]
    assert sum(row.good for row in designs) >= 3
    assert all(row.designed <= 1e-12 and row.in_file < 1e-6 for row in designs if row.good)


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "priors", "--quick", "--bodies", "1", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert {"rows", "designs"} <= set(record)
    assert record["bodies"] == 1
