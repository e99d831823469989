"""Commands print their output, and end with exit codes and plain errors."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file

import dicedesign as dd
from dicedesign.cli.main import main

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1.5)])


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return box_file(tmp_path, (1.0, 2.0, 3.0))


def answer_of(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_rests_as_json_and_as_a_table(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = answer_of(capsys, "rest", box)
    assert answer["hull"] == {"vertices": 8, "facets": 6}
    assert answer["center_of_mass_source"] == "uniform solid"
    rests = answer["rests"]
    assert [round(rest["area"], 9) for rest in rests] == [6.0, 6.0, 3.0, 3.0, 2.0, 2.0]
    assert sum(rest["probability"] for rest in rests) == pytest.approx(1.0, abs=1e-14)
    # The 1 x 2 x 3 box on its 2 x 3 side: the nearest edge is over the side of width 2.
    assert rests[0]["margin_deg"] == pytest.approx(np.degrees(np.arctan(2.0)), abs=1e-9)
    answer = answer_of(capsys, "rest", box, "--com", "-0.2,0.1,0.3")
    assert answer["center_of_mass"] == [-0.2, 0.1, 0.3]
    assert answer["center_of_mass_source"] == "given"
    assert main(["rest", str(box), "--com", "hull"]) == 0
    out = capsys.readouterr().out
    assert "6 resting poses, hull of 8 vertices and 6 facets" in out
    assert "uniform solid hull" in out
    assert len([line for line in out.splitlines() if " deg" in line]) == 6


def test_links_mass_and_all_facets(
    box: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot's links, one of them bad, beside a mesh with its own center and density."""
    robot, masses = tmp_path / "robot.urdf", tmp_path / "masses.csv"
    shape = "<collision><geometry><box size='{}'/></geometry></collision>"
    mass = "<inertial><origin xyz='0 0 {}'/><mass value='2'/></inertial>"
    links = (mass.format(-0.25) + shape.format("1 1 1"), mass.format(9) + shape.format("1 1 1"))
    text = "".join(
        f"<link name='{name}'>{link}</link>" for name, link in zip("ab", links, strict=True)
    )
    robot.write_text(f"<robot>{text}</robot>")
    masses.write_text(f"file,x,y,z,density\n{box},0,0,0.1,2\n{robot},,,,1\n")
    arguments = ["rest", str(robot), str(box), "--masses", str(masses), "--all-facets"]
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out.count("resting poses") == 2
    assert "rolls to rest" in captured.out
    assert captured.err.count("note: ") == 1
    assert main([*arguments, "--json"]) == 2
    first, second, third = json.loads(capsys.readouterr().out)
    assert (first["body"], first["unit"], first["volume_mm3"]) == ("a", "m", pytest.approx(1e9))
    assert first["mass_g"] == 2000.0
    assert first["inertia_1_g_mm2"] == pytest.approx(2000.0 * 1e6 / 6.0)
    assert first["center_of_mass"] == [0.0, 0.0, -0.25]
    assert [facet["depth"] for facet in first["facets"]] == pytest.approx([0.5, *[0.25] * 4, 0.5])
    assert "outside" in second["error"]
    assert third["center_of_mass"] == [0.0, 0.0, 0.1]
    assert (third["mass_g"], third["unit"]) == (pytest.approx(0.012), "mm")
    # The same as a table.
    table = tmp_path / "table.json"
    assert main([*arguments, "--out", str(table)]) == 2
    rows = json.loads(table.read_text())
    assert [row["file"] for row in rows] == [str(box)] * 6 + [str(robot)] * 7
    assert [row["body"] for row in rows] == [""] * 6 + ["a"] * 6 + ["b"]
    assert [row["mass_g"] for row in rows[5:7]] == [third["mass_g"], first["mass_g"]]
    assert second["error"] == f"{robot}: link b: {rows[-1]['error']}"


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
    drop = ["drop", box, "--down", "-0.3,0.2,1"]
    steps = answer_of(capsys, *drop)["steps"]
    heights = [step["height"] for step in steps]
    assert heights == sorted(heights, reverse=True)
    assert steps[-1]["contact"] == "facet"
    assert len(steps[-1]["points"]) == 4
    assert heights[-1] == pytest.approx(1.5)
    finer = answer_of(capsys, *drop, "--max-angle-deg", "2")["steps"]
    assert len(finer) > len(steps)
    turns = [np.array(step["transform"])[:3, :3] for step in finer]
    for a, b in pairwise(turns):
        cosine = (np.trace(a.T @ b) - 1.0) / 2.0
        assert np.degrees(np.arccos(min(1.0, cosine))) <= 2.0 + 1e-6
    assert main(["drop", str(box), "--down", "0,0,1"]) == 0
    assert "height of center" in capsys.readouterr().out


D4 = """name: d4
figures: false
report: false
print: false
engrave: false
target: {fair: 4}
start: {%s}
"""


def test_run_from_a_shell(tmp_path: Path) -> None:
    """An exit code, data on stdout, and no progress bar without a terminal."""
    (tmp_path / "d4.yaml").write_text(D4 % "repulsion: {}")
    method = "method.paper={step: line_search, finish: none, tolerance: 1e-14, steps: 1}"
    command = [sys.executable, "-m", "dicedesign", "run", "d4.yaml", "--set", method]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "\r" not in done.stderr
    assert done.stdout.startswith("d4: ")
    result = json.loads((tmp_path / "outputs" / "d4" / "result.json").read_text())
    assert result["status"] == "step_limit"


def test_notes_about_a_mesh_start_go_to_stderr(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("d4.obj").write_text("v 1 1 1\nv 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 1\n")
    Path("d4.yaml").write_text(D4 % "mesh: {path: d4.obj}")
    assert main(["run", "d4.yaml"]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("d4: The die has your probabilities ")
    assert captured.err.splitlines()[-1] == "note: welded 1 points to others at equal positions"


def test_rest_with_a_table_adds_throw_probabilities(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = box_file(tmp_path, (1.0, 1.3, 1.6))
    rests = answer_of(capsys, "rest", mesh, "--table", "board-game")["rests"]
    assert sum(rest["thrown"] for rest in rests) == pytest.approx(1.0)
    # Momentum favors probable rests.
    assert rests[0]["thrown"] > rests[0]["probability"]
    assert rests[-1]["thrown"] < rests[-1]["probability"]
    rests = answer_of(capsys, "rest", mesh, "--table", "carpet")["rests"]
    assert all(rest["thrown"] == rest["probability"] for rest in rests)


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
    rests = answer_of(capsys, "rest", box, "--prior", "vmf:0,-1,-1:3")["rests"]
    poses = dd.rest_poses(CORNERS).under(dd.VonMisesFisher([0.0, -1.0, -1.0], 3.0))
    probabilities = [rest["probability"] for rest in rests]
    np.testing.assert_allclose(probabilities, poses.probabilities, atol=1e-14)
    assert all(0.0 < rest["error"] < 1e-12 for rest in rests)
    samples = box.with_name("samples.csv")
    samples.write_text("x,y,z\n0,0,-1\n0.1,0,-2\n0,1,0.1\n0,0,-3\n")
    rests = answer_of(capsys, "rest", box, "--prior", f"samples:{samples}")["rests"]
    assert [rest["probability"] for rest in rests[:3]] == [0.75, 0.25, 0.0]
