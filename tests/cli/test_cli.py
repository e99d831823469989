"""Commands print their output, and end with exit codes and plain errors."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file, finished_result

import dicedesign as dd
from dicedesign.cli.main import main

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1.5)])


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return box_file(tmp_path, (1.0, 2.0, 3.0))


def run(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "dicedesign", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_rest_as_a_table(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rest", str(box)]) == 0
    out = capsys.readouterr().out
    assert "6 resting poses, hull of 8 vertices and 6 facets" in out
    assert "uniform solid" in out
    assert len([line for line in out.splitlines() if " deg" in line]) == 6


def test_rest_as_json(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rest", str(box), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert list(answer) == ["center_of_mass", "center_of_mass_source", "hull", "rests", "seconds"]
    assert answer["hull"] == {"vertices": 8, "facets": 6}
    assert answer["center_of_mass_source"] == "uniform solid"
    rests = answer["rests"]
    assert [sorted(rest) for rest in rests] == [
        ["area", "margin_deg", "normal", "probability", "transform"]
    ] * 6
    assert [round(rest["area"], 9) for rest in rests] == [6.0, 6.0, 3.0, 3.0, 2.0, 2.0]
    assert sum(rest["probability"] for rest in rests) == pytest.approx(1.0, abs=1e-14)
    # The 1 x 2 x 3 box on its 2 x 3 side: the nearest edge is over the side of width 2.
    assert rests[0]["margin_deg"] == pytest.approx(np.degrees(np.arctan(2.0)), abs=1e-9)
    assert sorted(answer["seconds"]) == ["hull", "rest"]


def test_a_bad_mesh_among_several(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    meshes = [str(box.with_name("none.stl")), str(box), str(box.parent), str(box)]
    assert main(["rest", *meshes]) == 2
    assert capsys.readouterr().out.count("6 resting poses") == 2
    assert main(["rest", *meshes, "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("note: ") == 2
    answer = json.loads(captured.out)
    assert [each["file"] for each in answer] == meshes
    assert [len(each.get("rests", "")) for each in answer] == [0, 6, 0, 6]


def test_center_of_mass_options(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rest", str(box), "--com", "-0.2,0.1,0.3", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["center_of_mass"] == [-0.2, 0.1, 0.3]
    assert answer["center_of_mass_source"] == "given"
    assert main(["rest", str(box), "--com", "hull"]) == 0
    assert "uniform solid hull" in capsys.readouterr().out


def test_a_point_cloud_has_a_note_on_its_center_of_mass(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "points.xyz"
    np.savetxt(path, np.random.default_rng(0).normal(size=(30, 3)))
    assert main(["rest", str(path)]) == 0
    captured = capsys.readouterr()
    assert "uniform solid hull" in captured.out
    assert "note: the body has no triangles" in captured.err


def test_drop(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["drop", str(box), "--down", "-0.3,0.2,1", "--json"]) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    heights = [step["height"] for step in steps]
    assert heights == sorted(heights, reverse=True)
    assert steps[-1]["contact"] == "facet"
    assert len(steps[-1]["points"]) == 4
    assert heights[-1] == pytest.approx(1.5)
    assert main(["drop", str(box), "--down", "-0.3,0.2,1", "--max-angle-deg", "2", "--json"]) == 0
    finer = json.loads(capsys.readouterr().out)["steps"]
    assert len(finer) > len(steps)
    turns = [np.array(step["transform"])[:3, :3] for step in finer]
    for a, b in pairwise(turns):
        cosine = (np.trace(a.T @ b) - 1.0) / 2.0
        assert np.degrees(np.arccos(min(1.0, cosine))) <= 2.0 + 1e-6
    assert main(["drop", str(box), "--down", "0,0,1"]) == 0
    assert "height of center" in capsys.readouterr().out


def test_run_from_a_shell(tmp_path: Path) -> None:
    """Exit codes 0 and 1, data on stdout, and no progress bar without a terminal."""
    recipe = tmp_path / "d4.yaml"
    recipe.write_text("name: d4\nseed: 1\ntarget: {fair: 4}\nstart: {repulsion: {}}\n")
    done = run(["run", "d4.yaml"], tmp_path)
    assert done.returncode == 0
    assert "\r" not in done.stderr
    assert done.stdout.startswith("d4: die.stl has your probabilities: off by ")
    assert (tmp_path / "outputs" / "d4" / "die.stl").stat().st_size > 0
    short_run = [
        "run",
        "d4.yaml",
        "--set",
        "method.paper={step: line_search, finish: none, tolerance: 1e-14, steps: 1}",
    ]
    ended = run([*short_run, "--out", "other"], tmp_path)
    assert ended.returncode == 1
    assert json.loads((tmp_path / "other" / "result.json").read_text())["status"] == "step_limit"


def test_tiny_probabilities_are_printed_with_all_their_digits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = tmp_path / "d3.yaml"
    recipe.write_text("name: d3\ntarget: {fair: 3}\nstart: {prism: {}}\n")
    result = replace(
        finished_result(["1", "22", "3"], [1e-6, 0.083, 0.916999]),
        probabilities=(0.000384711, 1.0, 0.0),
    )
    monkeypatch.setattr("dicedesign.recipe.pipeline.run", lambda *a, **k: result)
    assert main(["run", str(recipe)]) == 0
    assert capsys.readouterr().out.splitlines()[1:5] == [
        "label      target  die_plain.stl",
        "    1  1.0000e-06     0.00038471",
        "   22    0.083000         1.0000",
        "    3     0.91700         0.0000",
    ]


def test_notes_about_a_mesh_start_go_to_stderr(tmp_path: Path) -> None:
    (tmp_path / "d4.obj").write_text("v 1 1 1\nv 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 1\n")
    (tmp_path / "d4.yaml").write_text(
        "name: d4\ntarget: {fair: 4}\nstart: {mesh: {path: d4.obj}}\nengrave: false\n"
    )
    done = run(["run", "d4.yaml"], tmp_path)
    assert done.returncode == 0
    # A slow machine prints lines of progress before it.
    assert done.stderr.splitlines()[-1] == "note: welded 1 points to others at equal positions"


def test_rest_with_a_table_adds_throw_probabilities(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = box_file(tmp_path, (1.0, 1.3, 1.6))
    assert main(["rest", str(mesh), "--table", "board-game", "--json"]) == 0
    rests = json.loads(capsys.readouterr().out)["rests"]
    assert sum(rest["thrown"] for rest in rests) == pytest.approx(1.0)
    # Momentum favors probable rests.
    assert rests[0]["thrown"] > rests[0]["probability"]
    assert rests[-1]["thrown"] < rests[-1]["probability"]
    assert main(["rest", str(mesh), "--table", "carpet", "--json"]) == 0
    rests = json.loads(capsys.readouterr().out)["rests"]
    assert all(rest["thrown"] == rest["probability"] for rest in rests)
    assert main(["rest", str(mesh), "--table", "board-game"]) == 0
    heading = "rest probability thrown facet normal"
    assert heading in " ".join(capsys.readouterr().out.split())


def test_an_interrupt_that_a_library_wraps_is_an_interrupt(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """pydantic wraps the errors of functions that it calls."""

    def raise_interrupt(kind: object) -> None:
        raise KeyboardInterrupt

    # Ctrl-C while the recipe is written.
    monkeypatch.setattr("dicedesign.recipe.recipe.TypeAdapter", raise_interrupt)
    recipe = tmp_path / "four.yaml"
    recipe.write_text("name: four\ntarget: {fair: 5}\nstart: {prism: {}}\nengrave: false\n")
    assert main(["run", str(recipe), "--out", str(tmp_path / "out")]) == 130
    error = capsys.readouterr().err.splitlines()[-1]
    assert error == "dicedesign: interrupted; nothing half-written was left"


def test_a_prior_gives_probabilities_and_their_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    box = tmp_path / "box.xyz"
    np.savetxt(box, CORNERS)
    assert main(["rest", str(box), "--prior", "vmf:0,-1,-1:3", "--json"]) == 0
    rests = json.loads(capsys.readouterr().out)["rests"]
    poses = dd.rest_poses(CORNERS).under(dd.VonMisesFisher([0.0, -1.0, -1.0], 3.0))
    probabilities = [rest["probability"] for rest in rests]
    np.testing.assert_allclose(probabilities, poses.probabilities, atol=1e-14)
    assert all(0.0 < rest["error"] < 1e-12 for rest in rests)
    samples = box.with_name("samples.csv")
    samples.write_text("x,y,z\n0,0,-1\n0.1,0,-2\n0,1,0.1\n0,0,-3\n")
    assert main(["rest", str(box), "--prior", f"samples:{samples}", "--json"]) == 0
    rests = json.loads(capsys.readouterr().out)["rests"]
    assert [rest["probability"] for rest in rests[:3]] == [0.75, 0.25, 0.0]
