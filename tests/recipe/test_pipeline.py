"""Recipes run end to end and checked by other tools, and the stages."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from check_outputs import check
from common.finished import finished_result
from common.made_up_die import SIDES, box, run_to_check
from pygltflib import GLTF2

from dicedesign import rest_poses
from dicedesign.errors import EngravingError
from dicedesign.fabricate import file_formats
from dicedesign.fabricate.file_formats import FILE_FORMATS, Contents
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Callbacks, run
from dicedesign.recipe.reading import parse_recipe, read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.results.folder import read_result, write_results
from dicedesign.results.parts import Status
from dicedesign.results.result import StageTime

STONE = np.random.default_rng(3).normal(size=(14, 3)) * 20.0 + [100.0, -30.0, 7.0]
"""Points of a body with more than four rests, away from the origin."""

RECIPE = {"name": "x", "target": {"fair": 3}, "engrave": False, "start": {"prism": {}}}


def test_a_recipe_becomes_a_checked_die(convex_die: Path) -> None:
    assert check(convex_die)["status"] == "converged"
    result = read_result(convex_die)
    assert result.history[0].max_abs_error > result.history[-1].max_abs_error
    assert len(result.facets) == 11
    assert result.engraved.max_abs_error < 1e-6


def test_without_a_clock_the_same_seed_gives_the_same_bytes(
    repository: Path, convex_die: Path, tmp_path: Path
) -> None:
    recipe = read_recipe(repository / "recipes" / "2d6_hendecahedron.yaml", ["clock=false"])
    result = run(recipe, tmp_path)
    names = {path.name for path in convex_die.iterdir()}
    assert names == {path.name for path in tmp_path.iterdir()}
    assert {"result.json", "report.html", "convergence.png", "die.stl"} <= names
    for name in names:
        assert (tmp_path / name).read_bytes() == (convex_die / name).read_bytes(), name
    assert read_result(convex_die) == result


def test_a_clock_times_stages_and_steps(tmp_path: Path) -> None:
    stages: list[str] = []
    steps: list[int] = []
    callbacks = Callbacks(stages.append, lambda step: steps.append(step.step))
    given = parse_recipe({**RECIPE, "engrave": True, "figures": False})
    result = run(given, tmp_path / "new" / "die", callbacks=callbacks)
    assert steps == list(range(len(steps)))
    assert [stage.name for stage in result.stages] == stages
    assert all(stage.seconds >= 0.0 for stage in result.stages)
    assert 0.0 <= result.history[0].seconds <= result.history[-1].seconds
    assert result.stages[stages.index("design")].seconds >= result.history[-1].seconds


def stone_recipe(folder: Path, entries: str) -> Recipe:
    """Recipe that does not change its start, a stone."""
    lines = ["v " + " ".join(map(repr, corner.tolist())) for corner in STONE]
    (folder / "stone.obj").write_text("\n".join(lines))
    path = folder / "stone.yaml"
    path.write_text(
        f"name: stone\nstart: {{mesh: {{path: stone.obj}}}}\n{entries}\n"
        "method: {paper: {perturbation: 0.0, step: line_search, finish: none, steps: 0, "
        "tolerance: 1e-6}}\n"
    )
    return read_recipe(path)


def test_a_given_center_of_mass_is_in_the_mesh_s_own_coordinates(tmp_path: Path) -> None:
    center = [103.0, -32.5, 8.25]
    poses = rest_poses(STONE, center)
    recipe = stone_recipe(tmp_path, f"target: {{fair: 4}}\ncenter_of_mass: {center}")
    work = design_recipe(recipe, last="check")
    designed = work.solid.poses
    np.testing.assert_allclose(work.die.directions, poses.normals[:4], atol=1e-12)
    np.testing.assert_allclose(designed.probabilities, poses.probabilities, atol=1e-10)
    np.testing.assert_allclose(designed.normals, poses.normals, atol=1e-10)
    # The file holds it to single precision.
    np.testing.assert_allclose(work.plain.poses.probabilities, poses.probabilities, atol=1e-6)


def test_a_die_that_also_rests_elsewhere_is_off_target(tmp_path: Path) -> None:
    """The target assigns every rest to the nearest of four directions, as the energy does."""
    poses = rest_poses(STONE)
    nearest = np.argmax(poses.normals @ poses.normals[:4].T, axis=1)
    sums = np.bincount(nearest, poses.probabilities)
    recipe = stone_recipe(tmp_path, f"target: {{probabilities: {sums.tolist()}}}\nengrave: false")
    work = design_recipe(recipe)
    assert work.die.status is Status.CONVERGED
    assert work.status is Status.OFF_TARGET
    assert work.plain.outcomes.elsewhere == pytest.approx(poses.probabilities[4:].sum(), abs=1e-6)


def test_a_label_that_does_not_fit_leaves_old_results_alone(tmp_path: Path) -> None:
    files = {"die_plain.stl": b"of an earlier run"}
    write_results(tmp_path, files, finished_result(["a"], [1.0]))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    small = parse_recipe({**RECIPE, "engrave": True, "size_mm": 3})
    with pytest.raises(EngravingError, match=r"size_mm"):
        run(small, tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_an_interrupted_run_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []
    replace = os.replace

    def interrupt(partial: Path, path: str) -> None:
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(Path(path).name)
        replace(partial, path)

    monkeypatch.setattr(os, "replace", interrupt)
    (tmp_path / "result.json").write_text('{"sha256": {}}')
    with pytest.raises(KeyboardInterrupt):
        run(parse_recipe({**RECIPE, "figures": False}), tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(written)


def test_a_result_has_the_data_of_the_work() -> None:
    """A box with labels on three of its sides; a copy of the work is independent."""
    work = run_to_check(box(4.0, 5.0, 6.0), SIDES[:3], Status.NO_PROGRESS, {"fair": 3})
    work.extra["grams"] = 2.5
    work.die = replace(work.die, starts=5, terms={"dice": 0.25})
    result = work.result()
    assert (result.status, result.message) == ("no_progress", work.message)
    assert (result.extra, result.rest_counts) == ({"grams": 2.5}, (1, 1, 1))
    assert (result.design.starts, result.design.energy) == (5, {"dice": 0.25})
    assert result.least_angle_deg == pytest.approx(90.0, abs=1e-5)
    # Tipped from its smallest side over a longer edge.
    assert result.least_margin_deg == pytest.approx(np.degrees(np.arctan(4.0 / 6.0)), abs=1e-4)
    assert result.elsewhere == pytest.approx(0.5, abs=1e-6)
    twin = work.copy()
    for notes in (twin.remarks, twin.notes):
        notes.append("more")
    for entries in (twin.extra, twin.files, twin.images):
        entries["more"] = b""
    twin.stages.append(StageTime("more", 0.1))
    assert work.result() == result


# Callbacks.


@pytest.mark.parametrize(
    "entries",
    [
        {"start": {"search": {}}, "symmetry": "none"},
        {"start": {"prism": {}}, "method": {"paper": {"steps": 40}}, "assignment": [3, 1, 2]},
    ],
    ids=["exact", "paper"],
)
def test_shapes_have_the_probabilities_of_their_steps(entries: dict[str, Any]) -> None:
    target = {"probabilities": [0.5, 0.3, 0.2]}
    recipe = parse_recipe({"name": "d3", "target": target, **entries})
    shapes, errors, starts = [], [], []
    callbacks = Callbacks(
        on_start=starts.append,
        on_shape=lambda *shape: shapes.append(shape),
        on_step=lambda step: errors.append(step.max_abs_error),
    )
    work = design_recipe(recipe, callbacks, last="design")
    assert len(shapes) == len(errors) == len(work.die.steps)
    assert starts == list(range(len(starts)))
    assert len(starts) >= (work.die.starts if work.recipe.method.exact else 0)
    hull, directions = shapes[-1]
    np.testing.assert_array_equal(hull.vertices, work.die.hull.vertices)
    np.testing.assert_array_equal(directions, work.die.directions)
    for (hull, directions), error in zip(shapes, errors, strict=True):
        outcomes = outcome_probabilities(rest_poses(hull.vertices), directions)
        if outcomes.elsewhere < 1e-12 and (outcomes.rest_counts == 1).all():
            computed = outcomes.max_abs_error(recipe.target.target().probabilities)
            assert computed == pytest.approx(error, abs=1e-9)


class Enough(BaseException):
    """Exception of a callback."""


def test_an_exception_of_a_callback_ends_the_run() -> None:
    shapes = []

    def on_shape(*shape: Any) -> None:
        shapes.append(shape)
        if len(shapes) == 3:
            raise Enough

    recipe = parse_recipe({"name": "d5", "target": {"fair": 5}, "faces": "one"})
    with pytest.raises(Enough):
        design_recipe(recipe, Callbacks(on_shape=on_shape), last="design")
    assert len(shapes) == 3


# Files in every format.

FORMATS = [kind.name for kind in FILE_FORMATS]

COIN = {
    "name": "coin",
    "target": {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]},
    "start": {"prism": {}},
    **dict.fromkeys(("figures", "report", "clock"), False),
}


def test_files_carry_the_result_and_those_of_an_earlier_run_are_removed(tmp_path: Path) -> None:
    run({**COIN, "files": FORMATS}, tmp_path)
    result = read_result(tmp_path)
    names = {path.name for path in tmp_path.iterdir()} - {"result.json"}
    assert {f"die.{name}" for name in FORMATS} < names
    assert set(result.files.values()) == {*names, "result.json"}
    for name in names:
        assert result.sha256[name] == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
    facts = GLTF2().load(str(tmp_path / "die.glb")).asset.extras
    for name, values in (("Target", result.target), ("Probabilities", result.probabilities)):
        read = json.loads(facts[name])
        assert list(read) == list(result.labels)
        np.testing.assert_allclose(list(read.values()), values, atol=1e-6)
    assert facts["Recipe"] == (tmp_path / "recipe.yaml").read_text()
    assert facts["Checksum"].endswith(result.sha256["die.stl"])
    plain = run({**COIN, "engrave": False}, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(plain.files.values())
    assert set(plain.files) == {"die_plain", "recipe", "result"}


def test_a_file_with_other_probabilities_is_discarded(tmp_path: Path) -> None:
    def dent(contents: Contents) -> bytes:
        (part,) = contents.parts
        points = part.points.copy()
        points[0] *= 1.0 + 1e-6
        return file_formats.obj(replace(contents, parts=[replace(part, points=points)]))

    known = FILE_FORMATS["obj"]
    FILE_FORMATS.register(replace(known, write=dent), replace=True)
    try:
        result = run({**COIN, "engrave": False, "files": "obj"}, tmp_path / "coin")
    finally:
        FILE_FORMATS.register(known, replace=True)
    assert not result.converged
    assert "die_plain.obj" in result.message
    assert {path.name for path in (tmp_path / "coin").iterdir()} >= {"die_plain.stl", "result.json"}
    assert not (tmp_path / "coin" / "die_plain.obj").exists()
