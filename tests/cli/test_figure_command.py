"""`dicedesign figure` writes pictures."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh
from PIL import Image

from dicedesign.cli.main import main


@pytest.fixture
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Working directory with two meshes and a recipe."""
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((1, 2, 3)).export("box.stl")
    trimesh.creation.cylinder(1, 2, sections=11).export("rod.obj")
    Path("few.yaml").write_text(
        "name: few\ntarget: {binomial: 2}\nstart: {prism: {}}\nmethod: {paper: {steps: 30}}\n"
    )
    return tmp_path


@pytest.mark.parametrize(
    "arguments",
    [
        ["heights", "box.stl"],
        ["paths", "box.stl"],
        ["paths", "box.stl", "--down", "-1,0.2,0.4"],
        ["complex", "box.stl", "--com", "0.1,0,0.2"],
        ["drop", "rod.obj"],
        ["drop", "rod.obj", "--down", "0.3,0.1,1"],
        ["before_after", "box.stl", "--before", "rod.obj"],
        ["before_after", "few.yaml"],
        ["complex", "few.yaml"],
    ],
)
def test_a_picture_is_written(
    inside: Path, capsys: pytest.CaptureFixture[str], arguments: list[str]
) -> None:
    assert main(["figure", *arguments]) == 0
    name = f"{Path(arguments[1]).stem}_{arguments[0]}.png"
    assert capsys.readouterr().out == f"files: {name}\n"
    with Image.open(inside / name) as picture:
        assert min(picture.size) > 300


def test_rest_and_figure_draw_equal_pictures(inside: Path) -> None:
    assert main(["rest", "box.stl", "--figure", "a.png"]) == 0
    assert main(["figure", "complex", "box.stl", "--out", "b.png"]) == 0
    assert (inside / "a.png").read_bytes() == (inside / "b.png").read_bytes()
