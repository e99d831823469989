"""The bench of finished dice: its rows against the file and the recipe, and its verdict."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from common.benches import run_bench
from common.paths import ROOT

from dicedesign.bench.benches.finished import WAYS, Extent


def test_each_way_is_exact_in_its_file(capsys: pytest.CaptureFixture[str]) -> None:
    recipe = ROOT / "recipes" / "binomial_3.yaml"
    assert run_bench("finished", recipe, "--json", extent=Extent(ways=len(WAYS))) == 0
    rows = {row["way"]: row for row in json.loads(capsys.readouterr().out)["rows"]}
    assert list(rows) == list(WAYS)
    for way, row in rows.items():
        assert row["status"] == "converged"
        assert row["double"] <= 1e-9
        assert row["file"] <= 1e-6
        # A ball and filled labels leave the plain shape as it is.
        assert (row["rounds"] == 0) == (way in list(WAYS)[-2:])
        assert row["unbalanced"] >= row["double"]


def test_labels_without_room_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = tmp_path / "die.yaml"
    recipe.write_text("name: small\ntarget: {fair: 4}\nsize_mm: 4\n")
    assert run_bench("finished", recipe, extent=Extent(ways=1)) == 0
    assert "no room" in capsys.readouterr().out
