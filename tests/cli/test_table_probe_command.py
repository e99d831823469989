"""`dicedesign table probe`: how many throws tell how much, and the way from there to a table."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.finished_run import finished_run
from common.kernels import compiled_only

from dicedesign.cli.main import main
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.throw_counts import read_throw_counts, rolled_die


def frustum(sides: int, height: float, top: float) -> np.ndarray:
    """Corners (2 sides, 3) of a pyramid over a regular polygon of radius 1, cut off at `top`."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    return np.concatenate([ring, top * ring + [0.0, 0.0, height]])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A run that left a frustum of 20 mm."""
    hull = trimesh.convex.convex_hull(10.0 * frustum(6, 0.7, 0.4))
    poses = rest_poses(hull.vertices)
    labels = [str(i + 1) for i in range(len(poses.probabilities))]
    path = finished_run(
        tmp_path / "probe",
        labels,
        poses.probabilities.tolist(),
        zip(labels, poses.normals.tolist(), strict=True),
        center=poses.center_of_mass.tolist(),
    )
    hull.export(path / "die_plain.stl")
    return path


@compiled_only
def test_the_guide(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The more throws, the less is left open."""
    table = tmp_path / "rough.json"
    rough = {"restitution": 0.58, "friction": 0.7, "height": 0.15, "speed": 0.8, "spin": 40.0}
    table.write_text(json.dumps({"name": "rough", **rough}))
    command = ["table", "probe", str(folder), "--table", str(table)]
    assert main([*command, "--drops", "12000"]) == 0
    told = capsys.readouterr().out
    assert f"dicedesign rolls {folder} --log rolls.csv" in told
    lines = [line.split() for line in told.splitlines() if line]
    rows = [words for words in lines if words[0].isdigit()]
    throws, restitution, friction = (
        np.array([float(row[column]) for row in rows]) for column in (0, 1, 4)
    )
    assert (np.diff(throws) > 0.0).all()
    assert (np.diff(restitution) < 0.0).all()
    assert (np.diff(friction) < 0.0).all()
    assert main([*command, "--drops", "2000", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["table"]["name"], record["drops"]) == ("rough", 2000)
    assert [row["throws"] for row in record["errors"]] == throws.tolist()


def test_rolls_are_fitted_to_as_a_line_for_each_outcome_is(folder: Path, tmp_path: Path) -> None:
    rolls, throws = tmp_path / "rolls.csv", tmp_path / "throws.csv"
    rolls.write_text("label\n1\n1\n2\n8\n1\n")
    counts = {str(i): 0 for i in range(1, 9)} | {"1": 3, "2": 1, "8": 1}
    lines = [f"box,probe,{label},{count}\n" for label, count in counts.items()]
    throws.write_text("die,mesh,outcome,throws\n" + "".join(lines))
    (wanted,) = read_throw_counts(throws)
    found = rolled_die(folder, rolls)
    assert (found.name, found.labels) == (wanted.name, wanted.labels)
    assert found.size == pytest.approx(wanted.size)
    np.testing.assert_array_equal(found.counts, wanted.counts)
    np.testing.assert_array_equal(found.group_of_rest, wanted.group_of_rest)
    np.testing.assert_allclose(found.geometric, wanted.geometric)


@compiled_only
def test_from_rolls_to_a_table(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rolls = tmp_path / "rolls.csv"
    rolls.write_text("label\n" + "1\n2\n1\n2\n3\n" * 20)
    command = ["table", "fit", "--rolls", str(folder), str(rolls), "--jobs", "1", "--json"]
    main([*command, "--evaluations", "32", "--drops", "10"])
    record = json.loads(capsys.readouterr().out)
    assert [die["die"] for die in record["dice"]] == ["box"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["probe", "none"], "none"),
        (["probe", "FOLDER", "--drops", "10"], "--drops: expected a whole number of at least 2000"),
        (["probe", "FOLDER", "--table", "velvet"], "table velvet: expected board-game"),
        (["fit"], "table fit: expected --throws or --rolls, got neither"),
        (["fit", "--rolls", "FOLDER", "none.csv"], "none.csv: no such file"),
        (["fit", "--rolls", "FOLDER", "ROLLS", "--check", "a"], "add --throws"),
    ],
)
@compiled_only
def test_bad_input_is_said_plainly(
    folder: Path,
    tmp_path: Path,
    options: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    rolls = tmp_path / "rolls.csv"
    rolls.write_text("label\n1\n")
    given = {"FOLDER": str(folder), "ROLLS": str(rolls)}
    assert main(["table", *(given.get(word, word) for word in options)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error
