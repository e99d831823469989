"""Names of files that are not UTF-8 or have line feeds are printed and written safely."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from common.bodies import write_mesh
from common.parsed_html import parse_page

from dicedesign.cli.main import main
from dicedesign.errors import RecipeError, printable
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.reading import parse_recipe, read_recipe

RECIPE = "name: a\ntarget: {fair: 4}\nsize_mm: 30\nfigures: false\nstart: {mesh: {path: %s}}\n"

NAMES = [os.fsdecode(b"m\xff.stl"), "m\n<b>&.stl", "\x1b[31m.stl"]


def tetrahedron(path: Path) -> Path:
    hull = convex_hull(np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float))
    plain = path.with_name("plain.stl")
    write_mesh(plain, hull.vertices, hull.triangles)
    plain.rename(path)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_the_first_line_has_a_printable_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert main(["rest", str(tetrahedron(tmp_path / name))]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(f"{tmp_path}/{printable(name)}: 4 resting poses")
    assert printable(name).isprintable()


def test_a_recipe_from_a_folder_that_is_not_utf8(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / os.fsdecode(b"d\xff")
    folder.mkdir()
    tetrahedron(folder / "m.stl")
    (folder / "r.yaml").write_text(RECIPE % "m.stl")
    assert main(["run", str(folder / "r.yaml"), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert r"d\udcff/r.yaml: start.mesh.path: expected a text in UTF-8, got '" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("key", ["name", "labels.1", "target.fair"])
def test_lone_surrogates_are_refused_by_key(key: str) -> None:
    entries: dict[str, object] = {"name": "a", "target": {"fair": 4}, "labels": ["1", "2"]}
    if key == "name":
        entries["name"] = "\ud800"
    elif key == "labels.1":
        entries["labels"] = ["1", "\ud800"]
    else:
        entries["target"] = {"fair": Path("\udcff")}
    with pytest.raises(RecipeError, match=f"^{key}: expected a text in UTF-8"):
        parse_recipe(entries)


def test_files_of_a_run_are_utf8(tmp_path: Path) -> None:
    mesh = tetrahedron(tmp_path / "m\n<b>&.stl")
    recipe = tmp_path / "r.yaml"
    recipe.write_text(RECIPE % json.dumps(mesh.name))
    out = tmp_path / os.fsdecode(b"out\xff")
    assert main(["run", str(recipe), "--out", str(out)]) == 0
    assert read_recipe(out / "recipe.yaml").as_dict()["start"] == {
        "mesh": {"path": str(mesh), "repair": False}
    }
    json.loads((out / "result.json").read_bytes().decode("utf-8"))
    parse_page((out / "report.html").read_bytes().decode("utf-8"))
