"""`dicedesign balance`: exit codes, files and what is printed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.bodies import box, write_mesh
from PIL import Image

from dicedesign import read_body, rest_poses
from dicedesign.cli.main import main


@pytest.fixture
def leaning(tmp_path: Path) -> Path:
    surface = box((30.0, 36.0, 48.0), (14.0, 8.0, 0.0))
    write_mesh(tmp_path / "leaning.stl", surface.points, surface.triangles)
    return tmp_path / "leaning.stl"


def test_a_goal_that_is_reached(
    leaning: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "made"
    command = ["balance", str(leaning), "--stand-down", "24,0,-7", "--drain-mm", "3"]
    assert main([*command, "--by", "cavity", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "goal reached by cavity" in said.out
    assert "drains it" in said.err
    summary = json.loads((out / "balanced_balance.json").read_text())
    mesh = trimesh.load(out / "balanced.stl")
    np.testing.assert_allclose(mesh.center_mass, summary["center_mm"], atol=1e-4)
    (pose,) = summary["poses"]
    assert pose["probabilities"] > pose["before"]
    np.testing.assert_allclose(pose["normal"], [0.96, 0.0, -0.28], atol=1e-6)
    assert f"{100.0 * pose['probabilities']:.4f} %" in said.out
    others = rest_poses(read_body(out / "balanced.stl")).probabilities[1:]
    assert f"next pose {100.0 * others[0]:.1f} %" in said.out
    with Image.open(out / "balanced_balance.png") as picture:
        assert min(picture.size) > 500


def test_a_goal_that_is_not_reached_leaves_the_best(
    leaning: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "best.stl"
    command = ["balance", str(leaning), "--target", "0.9,0.1", "--poses", "6,5", "--json"]
    assert main([*command, "--by", "infill", "--out", str(out)]) == 1
    summary = json.loads(capsys.readouterr().out)
    assert not summary["reached"]
    assert summary["max_abs_error"] > 0.005
    assert sorted(path.name for path in tmp_path.glob("best*")) == sorted(
        Path(name).name for name in summary["files"]
    )
    assert (tmp_path / "best_sparse.stl").exists()
