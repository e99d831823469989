"""`dicedesign balance`: exit codes, files and what is printed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.boxes import box
from PIL import Image

from dicedesign.cli.main import main
from dicedesign.fabricate.file_formats import save_mesh


@pytest.fixture
def leaning(tmp_path: Path) -> Path:
    surface = box((30.0, 36.0, 48.0), (14.0, 8.0, 0.0))
    save_mesh(tmp_path / "leaning.stl", surface.points, surface.triangles)
    return tmp_path / "leaning.stl"


def test_a_goal_that_is_reached(
    leaning: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "made"
    command = ["balance", str(leaning), "--stand-down", "24,0,-7", "--drain-mm", "3"]
    assert main([*command, "--by", "cavity", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "by cavity" in said.out
    assert "drains it" in said.err
    found = json.loads((out / "balanced_balance.json").read_text())
    mesh = trimesh.load(out / "balanced.stl")
    np.testing.assert_allclose(mesh.center_mass, found["center_mm"], atol=1e-4)
    (pose,) = found["poses"]
    assert pose["odds"] > pose["before"]
    np.testing.assert_allclose(pose["normal"], [0.96, 0.0, -0.28], atol=1e-6)
    assert f"{100.0 * pose['odds']:.4f} %" in said.out
    with Image.open(out / "balanced_balance.png") as picture:
        assert min(picture.size) > 500


def test_a_goal_that_is_not_reached_leaves_the_best(
    leaning: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "best.stl"
    command = ["balance", str(leaning), "--target", "0.9,0.1", "--poses", "6,5", "--json"]
    assert main([*command, "--by", "infill", "--out", str(out)]) == 1
    found = json.loads(capsys.readouterr().out)
    assert not found["reached"]
    assert found["max_abs_error"] > 0.005
    assert sorted(path.name for path in tmp_path.glob("best*")) == sorted(
        Path(name).name for name in found["files"]
    )
    assert (tmp_path / "best_sparse.stl").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--equal", "1"], "equal: expected a number of poses from 2"),
        (["--stand", "77"], "stand: expected the number of a pose from 1 to"),
        (["--target", "0.5,0.7"], "target: expected probabilities"),
        (["--target", "0.5,x"], "--target: expected numbers"),
        (["--target", "1/2", "--poses", "a"], "--poses: expected numbers of poses"),
        (["--fewest", "--poses", "1"], "--poses: expected --target"),
        (["--fewest", "--region", "-1,-1,-1,0"], "region: expected six numbers"),
        (["--fewest", "--region", "900,900,900,901,901,901"], "region: expected a place"),
        (["--fewest", "--wall-mm", "100"], "wall_mm"),
        (["--fewest", "--out", "made.obj"], "--out: expected a folder or a file that ends in .stl"),
    ],
)
def test_bad_input(
    leaning: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    assert main(["balance", str(leaning), "--out", str(tmp_path / "made"), *options]) == 2
    err = capsys.readouterr().err
    assert said in err
    told = [line for line in err.splitlines() if not line.startswith("note: by ")]
    assert len(told) == 1


def test_meshes_that_cannot_be_balanced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    surface = box((30.0, 36.0, 48.0))
    save_mesh(tmp_path / "open.stl", surface.points, surface.triangles[1:])
    command = ["--fewest", "--out", str(tmp_path / "made")]
    assert main(["balance", str(tmp_path / "open.stl"), *command]) == 2
    assert "repair" in capsys.readouterr().err
    assert main(["balance", str(tmp_path / "none.stl"), *command]) == 2
    assert "none.stl" in capsys.readouterr().err


def test_the_mesh_itself_is_never_written_over(
    leaning: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = leaning.read_bytes()
    assert main(["balance", str(leaning), "--stand", "1", "--out", str(leaning)]) == 2
    assert "--out: expected another file than the mesh" in capsys.readouterr().err
    assert leaning.read_bytes() == before
