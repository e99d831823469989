"""`dicedesign rest --prior`: the odds of the Python call, and plain errors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import dicedesign as dd
from dicedesign.cli.main import main

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1.5)])


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.xyz"
    np.savetxt(path, CORNERS)
    return path


def test_json_has_odds_and_their_errors(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rest", str(box), "--prior", "vmf:0,-1,-1:3", "--json"]) == 0
    rests = json.loads(capsys.readouterr().out)["rests"]
    poses = dd.rest_poses(CORNERS).under(dd.VonMisesFisher([0.0, -1.0, -1.0], 3.0))
    found = [rest["probability"] for rest in rests]
    np.testing.assert_allclose(found, poses.probabilities, atol=1e-14)
    assert all(0.0 < rest["error"] < 1e-12 for rest in rests)


def test_samples_of_a_file(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seen = box.with_name("seen.csv")
    seen.write_text("x,y,z\n0,0,-1\n0.1,0,-2\n0,1,0.1\n0,0,-3\n")
    assert main(["rest", str(box), "--prior", f"samples:{seen}", "--json"]) == 0
    told = capsys.readouterr()
    rests = json.loads(told.out)["rests"]
    assert [rest["probability"] for rest in rests[:3]] == [0.75, 0.25, 0.0]
    assert "vmf:" in told.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--prior", "vmf:0,0,0:1"], "not all zero"),
        (["--prior", "half"], "half:x,y,z"),
        (["--prior", "samples:missing.csv"], "missing.csv"),
        (["--prior", "samples:"], "samples:FILE.csv"),
        (["--prior", "half:0,0,1", "--table", "paper"], "--table"),
    ],
)
def test_errors_are_one_plain_line(
    box: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["rest", str(box), *arguments]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("dicedesign: ")
    assert said in last


@pytest.mark.parametrize("line", ["1,2", "a,b,c", "0,0,0", "0,0,nan"])
def test_a_line_of_samples_that_is_no_direction(
    box: Path, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = box.with_name("seen.csv")
    seen.write_text(f"0,0,1\n{line}\n")
    assert main(["rest", str(box), "--prior", f"samples:{seen}"]) == 2
    assert "seen.csv" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("line", ["1,2", "0,zero,1", "0,0,1,"])
def test_a_first_line_with_numbers_is_no_line_of_names(
    box: Path, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = box.with_name("seen.csv")
    seen.write_text(f"{line}\n0,0,1\n")
    assert main(["rest", str(box), "--prior", f"samples:{seen}"]) == 2
    assert "in line 1" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("prior", ["half:0,0,1", ""])
def test_a_folder_is_refused(box: Path, prior: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(box.with_name("table.csv"))
    assert main(["rest", str(box.parent), "--out", out, "--prior", prior]) == 2
    assert "--prior" in capsys.readouterr().err
