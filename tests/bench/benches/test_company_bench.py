"""The bench of dice in company: its rows, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh
from common.benches import run_bench

from dicedesign.bench.benches.company import Extent
from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses

pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")


@pytest.fixture
def throws(tmp_path: Path) -> Path:
    mesh = tmp_path / "box.obj"
    trimesh.creation.box((1.0, 1.1, 1.25)).export(mesh)
    odds = rest_poses(read_body(mesh)).probabilities
    rows = [f"box,box.obj,{name},9,{p}" for name, p in zip("ABCDEF", odds, strict=True)]
    path = tmp_path / "throws.csv"
    path.write_text("die,mesh,outcome,throws,geometric\n" + "\n".join(rows) + "\n")
    return path


def test_a_box_in_both_companies(
    throws: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "near.json"
    numbers = {"restitution": 0.2, "friction": 0.5, "height": 0.03, "speed": 0.8, "spin": 9.0}
    table.write_text(json.dumps({"name": "near", **numbers}))
    arguments = ("--throws", throws, "--table", table, "--out", tmp_path)
    assert run_bench("company", *arguments, extent=Extent(200)) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    record = json.loads((tmp_path / "company.json").read_text())
    assert record["table"]["name"] == "near"
    assert [(row["die"], row["company"]) for row in record["rows"]] == [
        ("box", "die"),
        ("box", "wall"),
    ]
    for row in record["rows"]:
        assert row["throws"] == 200
        assert len(row["changes"]) == len(row["errors"]) == 3
        assert sum(row["changes"]) == pytest.approx(0.0, abs=1e-12)
        assert row["total_variation"] == pytest.approx(sum(map(abs, row["changes"])) / 2.0)
        assert max(row["changes"], key=abs) == row["change"]
        printed = next(line for line in lines if line[:2] == ["box", row["company"]])
        assert printed[2] == "200"
        assert float(printed[6]) == round(row["total_variation"], 4)


def test_without_a_file_a_box_is_thrown(tmp_path: Path) -> None:
    assert run_bench("company", "--out", tmp_path, extent=Extent(200)) == 0
    rows = json.loads((tmp_path / "company.json").read_text())["rows"]
    assert [row["die"] for row in rows] == ["box", "box"]
    assert all(len(row["changes"]) == 6 for row in rows)


def test_what_is_refused(throws: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "company", "--throws", str(throws), "--drops", "150"]) == 2
    assert "--drops: expected a multiple of 200, got 150" in capsys.readouterr().err
    assert main(["bench", "company", "--throws", str(throws), "--table", "felt"]) == 2
    assert "table felt: expected board-game" in capsys.readouterr().err
