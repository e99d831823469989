"""`dicedesign throw`: JSON, table, folders and errors."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file, finished_run
from common.kernels import compiled_only
from scipy import stats

from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.outcomes import asymmetry
from dicedesign.rest.poses import rest_poses
from dicedesign.throws import distances
from dicedesign.throws.momentum_probabilities import throw_probabilities
from dicedesign.throws.tables import Table, load_table

FEW = ("--drops", "300", "--jobs", "1", "--table", "carpet")


@pytest.fixture(autouse=True)
def few_transports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Transport distances take most of the time."""
    monkeypatch.setattr(distances, "TRANSPORT_DRAWS", 10)


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return box_file(tmp_path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Finished die with outcomes on its larger sides and an eccentric center of mass."""
    box_file(tmp_path, (10.0, 12.0, 15.0), "die_plain.stl")
    normals = {"one": [1.0, 0.0, 0.0], "two": [-1.0, 0.001, 0.0], "three": [0.0, 1.0, 0.0]}
    facets = [*normals.items(), (None, [0.0, -1.0, 0.0])]
    return finished_run(tmp_path, list(normals), [0.25, 0.25, 0.5], facets, center=[0.5, 0.0, 0.0])


def run_json(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    assert main(["throw", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@compiled_only
def test_the_json(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run_json(capsys, box, *FEW, "--seed", 3)
    assert (result["drops"], result["unresolved"], result["seed"]) == (300, 0, 3)
    assert (result["engine"], result["orientations"]) == ("native", "uniform")
    assert Table(**result["table"]) == load_table("carpet")
    poses = rest_poses(read_body(box))
    assert len(result["rests"]) == 6
    for rest, normal, probabilities in zip(
        result["rests"], poses.normals, poses.probabilities, strict=True
    ):
        assert list(rest) == ["normal", "count", "frequency", "interval", "geometric"]
        assert rest["normal"] == normal.tolist()
        assert rest["geometric"] == probabilities
        assert rest["frequency"] == rest["count"] / 300
        exact = stats.binomtest(rest["count"], 300).proportion_ci(0.95, "exact")
        np.testing.assert_allclose(rest["interval"], [exact.low, exact.high], rtol=1e-9)
    assert sum(rest["count"] for rest in result["rests"]) == 300
    variation = result["total_variation"]
    low, high = variation["interval"]
    assert low <= variation["value"] <= high
    assert 0.0 < variation["noise_floor"] < 0.1
    counts = [rest["count"] for rest in result["rests"]]
    expected = stats.chisquare(counts, 300 * poses.probabilities)
    assert result["chi_square"]["statistic"] == pytest.approx(expected.statistic)
    assert result["chi_square"]["p_value"] == pytest.approx(expected.pvalue)
    assert result["chi_square"]["degrees"] == 5
    assert result["asymmetry"] == asymmetry(poses)
    # To move a part of the probabilities takes at most pi, and at least the least angle of two
    # rests.
    moved = result["wasserstein"]["value"] / variation["value"]
    assert 0.5 * np.pi <= moved <= np.pi


@compiled_only
def test_another_throw_distribution(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    few = ("--drops", 200, "--jobs", 1)
    result = run_json(capsys, box, *few, "--hand", "cup")
    table = load_table("board-game").with_hand("cup")
    assert result["table"] == table.as_dict()
    assert Table(**result["table"]) == table
    assert sum(rest["count"] for rest in result["rests"]) == 200
    body = read_body(box)
    probabilities = [rest["momentum"] for rest in result["rests"]]
    expected = throw_probabilities(body, rest_poses(body), "board-game:cup")
    np.testing.assert_allclose(probabilities, expected, rtol=1e-12)
    assert np.abs(expected - throw_probabilities(body, rest_poses(body))).max() > 1e-6
    # Another throw distribution does not use the paper's orientations.
    assert run_json(capsys, box, *few, "--table", "paper", "--hand", "cup")["drops"] == 200
    assert main(["throw", str(box), *map(str, few), "--hand", "cup"]) == 0
    assert "geometric % momentum % facet normal" in " ".join(capsys.readouterr().out.split())


@compiled_only
def test_a_table_beyond_the_momentum_model_is_simulated(
    box: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = replace(load_table("board-game"), height=(3.0, 5.0))
    path = tmp_path / "tall.json"
    path.write_text(json.dumps(table.as_dict()))
    few = ("--table", str(path), "--drops", "100", "--jobs", "1")
    assert main(["throw", str(box), *few, "--json"]) == 0
    out, err = capsys.readouterr()
    assert (
        "note: without probabilities by the momentum model, as table board-game: expected a height"
        in err
    )
    rests = json.loads(out)["rests"]
    assert sum(rest["count"] for rest in rests) == 100
    assert "momentum" not in rests[0]


@compiled_only
def test_the_papers_orientations(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run_json(
        capsys, box, "--orientations", "icosahedron", "--table", "carpet", "--jobs", 1
    )
    assert result["drops"] == 1212
    assert sum(rest["frequency"] for rest in result["rests"]) == pytest.approx(1.0)
    weighted = [rest["frequency"] != rest["count"] / 1212 for rest in result["rests"]]
    assert any(weighted)
    for rest in result["rests"]:
        assert rest["interval"][0] < rest["frequency"] < rest["interval"][1]


@compiled_only
def test_the_text(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["throw", str(box), *FEW, "--size", "16"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{box}: 300 drops on carpet, 16 mm, engine native, ")
    heading = "rest count frequency % 95 % interval geometric % facet normal (down)"
    assert " ".join(lines[2].split()) == heading
    assert len({len(line) for line in lines[3:9]}) == 1
    assert lines[-3].startswith("total variation from the probabilities without momentum 0.0")
    assert lines[-2].startswith("Wasserstein distance from them, in radians, 0.")
    assert lines[-1].startswith("chi-square against them ")
    assert len(lines) == 13


@compiled_only
def test_a_folder_of_a_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run_json(capsys, folder, *FEW)
    labels = {tuple(np.round(rest["normal"])): rest["label"] for rest in result["rests"]}
    assert labels[1.0, 0.0, 0.0] == "one"
    assert labels[-1.0, 0.0, 0.0] == "two"
    assert labels[0.0, 1.0, 0.0] == "three"
    assert list(labels.values()).count(None) == 3
    # The center of mass of the design is nearer to the side of "one".
    probabilities = {rest["label"]: rest["geometric"] for rest in result["rests"]}
    assert probabilities["one"] > 1.1 * probabilities["two"]
    # It is thrown at its own size, in mm.
    assert result["table"]["size"] == pytest.approx(2e-3 * np.linalg.norm([5.5, 6.0, 7.5]))
    assert main(["throw", str(folder), *FEW]) == 0
    assert "  three  " in capsys.readouterr().out


@compiled_only
def test_another_center(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run_json(capsys, box, "--drops", 100, "--jobs", 1, "--com", "-0.2,0,0")
    best = max(result["rests"], key=lambda rest: rest["count"])
    assert best["normal"] == [-1.0, 0.0, 0.0]


def test_a_missing_extra(box: Path) -> None:
    """The error comes from the worker."""
    script = (
        "import sys; sys.modules['mujoco'] = None;"
        "from common.inline_executor import Inline; from contextlib import nullcontext;"
        "from dicedesign.runtime import workers;"
        "workers.local_workers = lambda jobs: nullcontext(Inline());"
        "from dicedesign.cli.main import main; sys.exit(main(sys.argv[1:]))"
    )
    throw = ["throw", str(box), "--engine", "mujoco", "--drops", "1"]
    command = [sys.executable, "-c", script, *throw]
    tests = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=tests, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert "engine mujoco: expected the optional extra 'throws', but" in done.stderr
    assert "pip install 'dicedesign[throws]'" in done.stderr
