"""Checks of starts, repaired meshes, and subjects of figures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from common.bodies import write_mesh
from common.bumpy import bumpy_sphere
from common.dented_cube import MadeUpSearch
from common.made_up_die import box

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.starts.shapes import prism
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work, run
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.recipe.subjects import subject_of
from dicedesign.results.folder import read_result


@dataclass(frozen=True)
class Nothing:
    """Options of a start without any."""


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
    hull = convex_hull(corners + np.array([7.0, -5.0, 3.0]))
    write_mesh(tmp_path / "wedge.obj", hull.vertices, hull.triangles)
    start = {"mesh": {"path": str(tmp_path / "wedge.obj")}}
    work = run_start(target={"fair": 2}, start=start, symmetry="C1")
    np.testing.assert_allclose(convex_hull(work.start.points).centroid, 0.0, atol=1e-12)


def test_images_may_differ_in_probability_by_rounding() -> None:
    probabilities = [0.1 + 0.2, 0.2, 0.3, 0.2]
    assert probabilities[0] != probabilities[2]
    run_start(target={"probabilities": probabilities}, symmetry="C2")
    with pytest.raises(InputError, match="equally probable"):
        run_start(target={"probabilities": [0.3, 0.3, 0.2, 0.2]}, symmetry="C2")


@pytest.mark.parametrize("count", [3, 5])
def test_a_start_with_a_wrong_number_of_directions_is_refused(count: int) -> None:
    shape = prism(4)
    wrong = replace(shape, directions=np.resize(shape.directions, (count, 3)))
    kind = StartKind(name="wrong", line="", options=Nothing, make=lambda *_: wrong)
    STARTS.register(kind)
    try:
        with pytest.raises(InputError, match=r"start.wrong: .* 4 outcomes"):
            run_start(target={"fair": 4}, start={"wrong": {}})
    finally:
        STARTS.unregister("wrong")


# Repaired meshes.


def repaired_recipe(path: Path, surface: Surface) -> Recipe:
    """Write a surface, and make a recipe of it."""
    write_mesh(path, surface.points, surface.triangles)
    return parse_recipe(
        {
            "name": "repaired",
            "target": {"fair": 2},
            "start": {"mesh": {"path": str(path), "repair": True}},
            "method": {"concave": {"tolerance": 0.02, "attempts": 1}},
            **dict.fromkeys(("print", "figures", "report"), False),
        }
    )


def test_a_die_of_an_open_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Repaired on a coarse grid; its search fails, so that it keeps the repaired surface."""
    monkeypatch.setattr("dicedesign.geometry.surfaces.repair.CELLS", 30)
    search = MadeUpSearch()
    search.leads_nowhere = True
    monkeypatch.setattr("dicedesign.recipe.concave.make_concave_die", search)
    whole = bumpy_sphere(1)
    # A sheet inside makes it more than a surface with a hole.
    triangles = np.vstack([whole.triangles[2:], [[0, 20, 40]]])
    recipe = repaired_recipe(tmp_path / "open.obj", Surface(whole.points, triangles))
    result = run(recipe, tmp_path / "out")
    repair = result.concave.repair
    assert (repair.pieces, repair.handles, repair.handles_before) == (1, 0, None)
    assert 0.0 < repair.off_mean < 1e-2
    assert any(note.startswith("repaired the mesh") for note in result.notes)
    assert read_result(tmp_path / "out").concave.repair == repair
    assert trimesh.load_mesh(tmp_path / "out" / "die_plain.stl").is_watertight


def test_a_good_mesh_is_not_changed(tmp_path: Path) -> None:
    original = bumpy_sphere(2)
    work = design_recipe(repaired_recipe(tmp_path / "good.obj", original), last="start")
    np.testing.assert_array_equal(work.surface.points, original.points)
    assert work.repaired is None


# Subjects of figures: meshes, recipes and results folders.


PAPER = {
    "name": "few",
    "target": {"binomial": 2},
    "start": {"prism": {}},
    "method": {"paper": {"steps": 40}},
    "figures": False,
    "report": False,
}


@pytest.fixture(scope="module")
def paper_die(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results folder of a run by the paper's method."""
    out = tmp_path_factory.mktemp("run") / "few"
    run(PAPER, out=out)
    return out


def test_a_recipe_and_its_folder_are_the_same_die(paper_die: Path) -> None:
    finished, designed = subject_of(paper_die), subject_of(paper_die / "recipe.yaml")
    assert finished.labels == designed.labels
    assert set(finished.labels or ()) >= {"0", "1", "2"}
    np.testing.assert_allclose(
        finished.poses.probabilities, designed.poses.probabilities, atol=1e-7
    )
    for subject in (finished, designed):
        before, after = convex_hull(subject.make_before().points), subject.poses.hull
        assert before.diameter == pytest.approx(after.diameter)
        np.testing.assert_allclose(before.centroid, after.centroid, atol=1e-9)
        # The prism is not the die.
        assert len(before.vertices) != len(after.vertices)


def test_a_die_under_a_prior_has_its_probabilities_and_labels_under_it(tmp_path: Path) -> None:
    prior = "half:0.2,0.3,-1"
    recipe = {**PAPER, "target": {"probabilities": [0.4, 0.3, 0.2, 0.1]}, "prior": prior}
    del recipe["start"], recipe["method"]
    out = tmp_path / "die"
    result = run({**recipe, "engrave": False, "print": False}, out=out)
    subject = subject_of(out)
    probabilities = dict(zip(subject.labels or (), subject.poses.probabilities, strict=True))
    for label, wanted in zip(result.labels, result.target, strict=True):
        assert probabilities[label] == pytest.approx(wanted, abs=1e-6)
    for facet in result.facets:
        if facet.label is not None:
            apart = np.linalg.norm(subject.poses.normals - facet.normal, axis=1)
            assert (subject.labels or ())[int(apart.argmin())] == facet.label


def test_a_recipe_that_searches_has_no_start(tmp_path: Path) -> None:
    recipe = tmp_path / "d4.yaml"
    recipe.write_text("name: d4\ntarget: {fair: 4}\nsymmetry: none\n")
    with pytest.raises(InputError, match="search"):
        subject_of(recipe).make_before()
