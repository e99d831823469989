"""Checks of starts, and repaired meshes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.bumpy import bumpy_sphere
from common.made_up_die import box
from PIL import Image

from dicedesign.concave.shapes import shape
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.starts.shapes import prism
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work, run
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.folder import read_result


def run_start(**entries: Any) -> Work:
    given = {"name": "die", "start": {"prism": {}}, "engrave": False, **entries}
    return design_recipe(parse_recipe(given), last="start")


def test_a_die_too_large_for_its_table_is_refused() -> None:
    large = {"target": {"fair": 4}, "size_mm": 1000.0}
    run_start(**large)
    thrown = {"exact": {"probabilities": "thrown"}}
    run_start(target={"fair": 4}, method=thrown)
    with pytest.raises(InputError, match="table board-game"):
        run_start(**large, method=thrown)


def test_a_symmetric_start_is_moved_to_its_centroid(tmp_path: Path) -> None:
    """Every symmetry fixes the centroid."""
    corners = box(1.0, 2.0, 3.0)
    corners[corners[:, 2] > 0.0] *= [0.6, 0.6, 1.0]
    points = corners + np.array([7.0, -5.0, 3.0])
    lines = ["v " + " ".join(map(repr, x)) for x in points.tolist()]
    (tmp_path / "wedge.obj").write_text("\n".join(lines))
    start = {"mesh": {"path": str(tmp_path / "wedge.obj")}}
    work = run_start(target={"fair": 2}, start=start, symmetry="C1")
    np.testing.assert_allclose(convex_hull(work.start.points).centroid, 0.0, atol=1e-12)


def test_images_may_differ_in_probability_by_rounding() -> None:
    probabilities = [0.1 + 0.2, 0.2, 0.3, 0.2]
    assert probabilities[0] != probabilities[2]
    prism = {"target": {"probabilities": probabilities}, "start": {"prism": {}}}
    run_start(**prism, symmetry="C2")
    with pytest.raises(InputError, match="equally probable"):
        run_start(
            target={"probabilities": [0.3, 0.3, 0.2, 0.2]}, start={"prism": {}}, symmetry="C2"
        )


@dataclass(frozen=True)
class Nothing:
    """Options of an invalid start."""


@pytest.mark.parametrize("directions", [3, 5])
def test_a_start_with_a_wrong_number_of_directions_is_refused(directions: int) -> None:
    shape = prism(4)
    wrong = replace(shape, directions=np.resize(shape.directions, (directions, 3)))
    STARTS.register(
        StartKind(
            name="wrong",
            line="has not as many directions as there are outcomes",
            options=Nothing,
            make=lambda options, task: wrong,
        )
    )
    try:
        with pytest.raises(InputError, match=r"start.wrong: expected .* each of the 4 outcomes"):
            run_start(target={"fair": 4}, start={"wrong": {}})
    finally:
        STARTS.unregister("wrong")


# Repaired meshes.


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
    result = run(parse_recipe(recipe), tmp_path / "out")
    repair = result.concave.repair
    assert (repair.pieces, repair.handles, repair.handles_before) == (1, 0, None)
    assert 0.0 < repair.off_mean < 1e-3
    assert any(note.startswith("repaired the mesh") for note in result.notes)
    with Image.open(tmp_path / "out" / "repair.png") as picture:
        assert picture.width > 600
    assert "repair.png" in (tmp_path / "out" / "report.html").read_text()
    assert read_result(tmp_path / "out").concave.repair == repair


def test_a_good_mesh_is_not_changed(tmp_path: Path) -> None:
    original = bumpy_sphere(2)
    recipe = parse_recipe(write_recipe(tmp_path / "good.obj", original))
    work = design_recipe(recipe, last="start")
    np.testing.assert_array_equal(work.surface.points, original.points)
    assert work.repaired is None
    assert work.notes == ["the mesh needed no repair"]
