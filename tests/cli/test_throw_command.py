"""`dicedesign throw`: JSON, table and folders."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.finished import box_file, finished_run
from common.kernels import compiled_only
from scipy import stats

from dicedesign.cli import throws
from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.outcomes import asymmetry
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.momentum_probabilities import throw_probabilities
from dicedesign.throws.simulation import Throws
from dicedesign.throws.tables import Table, load_table

pytestmark = compiled_only

FEW = ("--drops", "300", "--jobs", "1")


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return box_file(tmp_path)


def run_json(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    assert main(["throw", *map(str, arguments), *FEW, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_frequencies_beside_probabilities(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run_json(capsys, box, "--table", "carpet", "--seed", 3)
    assert (result["drops"], result["unresolved"], result["seed"]) == (300, 0, 3)
    assert result["engine"] == "native"
    assert Table(**result["table"]) == load_table("carpet")
    poses = rest_poses(read_body(box))
    counts = [rest["count"] for rest in result["rests"]]
    assert sum(counts) == 300
    for rest, normal, probability in zip(
        result["rests"], poses.normals, poses.probabilities, strict=True
    ):
        assert list(rest) == ["normal", "count", "frequency", "interval", "geometric"]
        assert (rest["normal"], rest["geometric"]) == (normal.tolist(), probability)
        assert rest["frequency"] == rest["count"] / 300
        exact = stats.binomtest(rest["count"], 300).proportion_ci(0.95, "exact")
        np.testing.assert_allclose(rest["interval"], [exact.low, exact.high], rtol=1e-9)
    variation = result["total_variation"]
    deviation = np.abs(np.array(counts) / 300 - poses.probabilities).sum() / 2
    assert variation["value"] == pytest.approx(deviation)
    assert variation["interval"][0] <= deviation <= variation["interval"][1]
    assert 0.0 < variation["noise_floor"] < 0.1
    expected = stats.chisquare(counts, 300 * poses.probabilities)
    assert result["chi_square"] == {
        "statistic": pytest.approx(expected.statistic),
        "degrees": 5,
        "p_value": pytest.approx(expected.pvalue),
    }
    assert result["asymmetry"] == asymmetry(poses)


def test_rests_that_few_throws_or_none_reach(
    box: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A rest without a throw counts; without any throw that comes to rest nothing is compared."""
    few = ["throw", str(box), "--drops", "3", "--jobs", "1", "--json"]
    assert main(few) == 0
    result = json.loads(capsys.readouterr().out)
    rests = result["rests"]
    assert min(rest["count"] for rest in rests) == 0
    deviation = sum(abs(rest["frequency"] - rest["geometric"]) for rest in rests) / 2
    assert result["total_variation"]["value"] == pytest.approx(deviation)
    simulated = throws.simulate

    def end_on_no_facet(*given: Any, **options: Any) -> Throws:
        return replace(simulated(*given, **options), outcomes=np.full(3, -1))

    monkeypatch.setattr(throws, "simulate", end_on_no_facet)
    assert main(few) == 1
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert result["unresolved"] == result["drops"] == 3
    assert result["total_variation"] is result["chi_square"] is None
    assert {rest["frequency"] for rest in result["rests"]} == {None}
    assert "none of 3 drops came to rest" in err


def test_as_a_table(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["throw", str(box), *FEW, "--hand", "cup", "--size", "16"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{box}: 300 drops on board-game:cup, 16 mm, engine native, ")
    assert "momentum %" in lines[2]
    assert lines[-1].startswith("chi-square against them ")


def test_a_throw_distribution_and_a_center(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    center = "-0.2,0,0"
    result = run_json(capsys, box, "--hand", "cup", "--com", center)
    assert Table(**result["table"]) == load_table("board-game").with_hand("cup")
    body = read_body(box)
    poses = rest_poses(body, [float(x) for x in center.split(",")])
    expected = throw_probabilities(body, poses, "board-game:cup")
    momentum = [rest["momentum"] for rest in result["rests"]]
    np.testing.assert_allclose(momentum, expected, rtol=1e-12)
    assert np.abs(expected - throw_probabilities(body, poses)).max() > 1e-6
    best = max(result["rests"], key=lambda rest: rest["count"])
    assert best["normal"] == [-1.0, 0.0, 0.0]


def test_a_table_beyond_the_momentum_model_is_simulated(
    box: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "tall.json"
    path.write_text(json.dumps(replace(load_table("board-game"), height=(3.0, 5.0)).as_dict()))
    assert main(["throw", str(box), "--table", str(path), *FEW, "--json"]) == 0
    out, err = capsys.readouterr()
    assert "note: without probabilities by the momentum model, as table board-game: exp" in err
    rests = json.loads(out)["rests"]
    assert sum(rest["count"] for rest in rests) == 300
    assert "momentum" not in rests[0]


def test_a_folder_of_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Outcomes on the larger sides, and an eccentric center of mass."""
    box_file(tmp_path, (10.0, 12.0, 15.0), "die_plain.stl")
    normals = {"one": [1.0, 0.0, 0.0], "two": [-1.0, 0.001, 0.0], "three": [0.0, 1.0, 0.0]}
    facets = [*normals.items(), (None, [0.0, -1.0, 0.0])]
    folder = finished_run(
        tmp_path, list(normals), [0.25, 0.25, 0.5], facets, center=[0.5, 0.0, 0.0]
    )
    result = run_json(capsys, folder, "--table", "carpet")
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
