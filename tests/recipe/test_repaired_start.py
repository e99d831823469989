"""Concave dice of repaired meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from common.bumpy import bumpy_sphere
from PIL import Image

from dicedesign.concave.shapes import shape
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe import pipeline
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.solid import make_start
from dicedesign.results.folder import read_result


def write_recipe(path: Path, surface: Surface, first: int = 0) -> dict[str, Any]:
    """Write a surface without its first triangles, and return a recipe of it."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in surface.points.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (surface.triangles[first:] + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return {
        "name": "repaired",
        "target": {"fair": 3},
        "start": {"mesh": {"path": str(path), "repair": True}},
        "method": {"concave": {}},
        "size_mm": 40,
        "print": False,
    }


def test_a_die_of_an_open_mesh(tmp_path: Path) -> None:
    duck = shape("duck")
    recipe = write_recipe(tmp_path / "duck.obj", duck, 20)
    recipe["method"]["concave"]["points"] = 1200
    result = pipeline.run(parse_recipe(recipe), tmp_path / "out")
    repair = result.concave.repair
    assert repair is not None
    assert (repair.pieces, repair.handles, repair.handles_before) == (1, 0, None)
    assert 0.0 < repair.off_mean < 1e-3
    assert any(note.startswith("repaired the mesh") for note in result.notes)
    with Image.open(tmp_path / "out" / "repair.png") as picture:
        assert picture.width > 600
    assert "repair.png" in (tmp_path / "out" / "report.html").read_text()
    assert read_result(tmp_path / "out").concave.repair == repair


def test_a_good_mesh_is_not_changed(tmp_path: Path) -> None:
    original = bumpy_sphere(2)
    work = Work(parse_recipe(write_recipe(tmp_path / "good.obj", original)))
    make_start(work)
    assert work.surface is not None
    np.testing.assert_array_equal(work.surface.points, original.points)
    assert work.repaired is None
    assert work.notes == ["the mesh needed no repair"]
