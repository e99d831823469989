"""Recipes of concave dice from file to folder: results and checkpoints with a replaced search, and
real searches."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from check_outputs import check
from common.dented_cube import MadeUpSearch, write_cube
from common.kernels import usual_notes
from common.processes import kill_at_write

from dicedesign import rest_poses
from dicedesign.cli.main import main
from dicedesign.errors import InputError, LabelRoomError
from dicedesign.geometry.meshes.body import shells_of
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe import pipeline
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Callbacks
from dicedesign.recipe.reading import read_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.results.folder import read_result
from dicedesign.results.result import Result

PICTURES = {
    "rests",
    "trade_off",
    "before_after",
    "probabilities",
    "hull",
    "displacement",
    "energy",
    "print_orientation",
}


@pytest.fixture
def recipe_path(tmp_path: Path) -> Path:
    """Recipe of a dented cube, which is a fair die, without figures and limits of printers."""
    write_cube(tmp_path / "cube.obj")
    path = tmp_path / "cube.yaml"
    entries = {
        "name": "cube",
        "target": {"fair": 6},
        "start": {"mesh": {"path": "cube.obj"}},
        "method": "concave",
        "size_mm": 40,
        **dict.fromkeys(("print", "figures", "report"), False),
    }
    path.write_text(yaml.safe_dump(entries))
    return path


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> MadeUpSearch:
    """Replacement of the real search."""
    made_up = MadeUpSearch()
    monkeypatch.setattr("dicedesign.recipe.concave.make_concave_die", made_up)
    return made_up


def stretch(points: np.ndarray) -> np.ndarray:
    """Make a box of the cube."""
    return points * [1.0, 1.1, 1.25]


def run(path: Path, folder: Path, *changes: str, resume: bool = False) -> Result:
    return pipeline.run(path, folder, changes=changes, resume=resume)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_the_folder_of_a_die_with_labels(concave_die: Path) -> None:
    """Of a real search, with all figures."""
    summary = check(concave_die)
    assert summary["status"] == "converged"
    assert set(summary["files"]) == PICTURES | {
        "die", "die_plain", "recipe", "report", "result", "reading",
    }  # fmt: skip
    page = (concave_die / "report.html").read_text()
    for name in ("before_after.png", "die_plain.stl", "max |p - q| is "):
        assert name in page


def test_a_recipe_becomes_a_die(recipe_path: Path, tmp_path: Path, search: MadeUpSearch) -> None:
    """In a folder of an earlier run, whose files are removed."""
    folder = tmp_path / "out"
    folder.mkdir()
    for name in ("gauss_map.png", "checkpoint.npz", "result.json", "mine"):
        (folder / name).write_bytes(b"of an earlier run")
    stages: list[str] = []
    steps: list[tuple[int, str]] = []
    recipe = read_recipe(recipe_path, ["engrave=true"])
    callbacks = Callbacks(stages.append, lambda step: steps.append((step.attempt, step.stage)))
    result = pipeline.run(recipe, folder, callbacks=callbacks)
    assert result.converged
    assert names(folder) == sorted(["mine", *result.files.values()])
    assert read_result(folder) == result
    assert read_recipe(folder / "recipe.yaml") == recipe
    assert "\nconverged: reached the tolerance; max |p - q| is " in result.message
    assert " in die.stl" in result.message
    assert steps == [(k, stage) for k in (1, 2, 3) for stage in ("hull", "fill")]
    assert [stage.name for stage in result.stages] == stages
    assert stages == ["start", "load", "design", "export", "check", "engrave"]
    # The dents went from 0.1 to 0.13 in 6 of 14 points, where the side is 2.
    assert result.concave.displacement.largest == pytest.approx(0.03 / np.sqrt(12.0))
    assert result.concave.displacement.mean == pytest.approx(6 / 14 * 0.03 / np.sqrt(12.0))
    assert result.concave.hull.gap < 1e-6
    assert result.rest_counts == (1,) * 6
    assert 0.0 < result.engraved.max_abs_error < 0.002


def test_the_verdict_is_that_of_the_file(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """The search reports success, but the die is a box."""
    search.change = stretch
    result = run(recipe_path, tmp_path / "out")
    assert result.status == "off_target"
    mesh = trimesh.load_mesh(result.folder / "die_plain.stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    poses = rest_poses(mesh)
    outcome = np.argmax(poses.normals @ np.concatenate([np.eye(3), -np.eye(3)]).T, axis=1)
    probabilities = np.empty(6)
    probabilities[outcome] = poses.probabilities
    np.testing.assert_allclose(result.probabilities, probabilities, atol=1e-12)
    assert result.max_abs_error == pytest.approx(np.abs(probabilities - 1 / 6).max(), abs=1e-12)
    assert result.max_abs_error > 0.02
    assert "the probabilities of the outcomes are off by more than the tolerance" in result.message
    # The designed hull is a cube with corners at (1, 1, 1), now at (1, 1.1, 1.25).
    assert "the surface does not fill the designed hull" in result.message
    outside = 0.25 / (2.0 * np.sqrt(1.0 + 1.1**2 + 1.25**2))
    assert result.concave.hull.gap >= outside - 1e-6
    assert "this is the best of 3 attempts" in result.message


def test_a_die_whose_prints_miss_is_fragile(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    within = "method.concave.prints_within=1e-4"
    result = run(recipe_path, tmp_path / "out", within, "print=true")
    assert result.status == "fragile"
    assert result.max_abs_error < 1e-6
    assert result.tolerances.total_variation > 1e-4
    assert all(draft.prints > 1e-4 for draft in result.search.trade_off.drafts)
    assert "The die has your probabilities, but its prints are off" in result.message
    assert f"{result.tolerances.total_variation:.2g}, wanted are at most 0.0001" in result.message
    unprinted = run(recipe_path, tmp_path / "plain", within)
    assert unprinted.converged
    assert [draft.prints for draft in unprinted.search.trade_off.drafts] == [None] * 3


def test_rests_without_outcome_are_a_flaw(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    changes = ["target={probabilities: [0.5, 0.25, 0.25]}", "method.concave.tolerance=0.4"]
    result = run(recipe_path, tmp_path / "out", *changes)
    assert result.status == "stray"
    assert result.elsewhere == pytest.approx(0.5)
    assert "the die also rests elsewhere, more often than the tolerance" in result.message
    assert "the tolerance is not below the smallest outcome, 0.25" in result.message


def test_a_failed_search_keeps_the_surface(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """The target has more outcomes than the cube has sides."""
    search.leads_nowhere = True
    result = run(recipe_path, tmp_path / "out", "target={fair: 9}", "engrave=true")
    assert result.status == "unchanged"
    assert "method.concave.tolerance" not in result.message
    assert (result.search.attempts, result.search.attempt) == (3, None)
    assert (result.concave.displacement.mean, result.concave.displacement.largest) == (0.0, 0.0)
    np.testing.assert_allclose(result.probabilities, [1 / 6] * 6 + [0.0] * 3, atol=1e-7)
    np.testing.assert_allclose(result.probabilities, result.concave.probabilities_before, atol=1e-7)
    assert result.rest_counts == (1,) * 6 + (0,) * 3
    assert result.elsewhere == pytest.approx(0.0, abs=1e-6)
    assert "die" not in result.files


def test_a_self_intersecting_surface_has_not_converged(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """Two opposite dents are so deep that they intersect."""

    def push(points: np.ndarray) -> np.ndarray:
        deep = points.copy()
        deep[[8, 11], 0] *= -0.5
        return deep

    search.change = push
    result = run(recipe_path, tmp_path / "out")
    assert result.status == "self_intersecting"
    assert result.concave.self_intersections > 0
    assert any("intersects itself" in sentence for sentence in result.concave.quality)
    assert any("intersects itself" in note for note in result.notes)


@pytest.mark.full
def test_a_die_with_many_flaws_is_written_with_all_figures(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """A dent goes through the opposite side."""
    search.change = lambda points: np.where(np.arange(14)[:, None] == 8, -3.0 * points, points)
    shown = ["print={printer: fdm, oriented: true}", "figures=true", "report=true"]
    result = run(recipe_path, tmp_path / "out", "engrave=true", *shown)
    assert result.status == "off_target"
    assert result.concave.self_intersections > 0
    assert PICTURES | {"die_plain", "die_oriented", "report", "crossings"} <= set(result.files)
    assert "die" not in result.files
    assert result.tolerances is None


def test_marks_that_do_not_fit(recipe_path: Path, tmp_path: Path, search: MadeUpSearch) -> None:
    """An error for a converged die, else a remark."""
    folder = tmp_path / "out"
    with pytest.raises(LabelRoomError, match=r"min_height_mm.*--resume"):
        run(recipe_path, folder, "engrave=true", "size_mm=5")
    assert names(folder) == ["checkpoint.npz"]
    # The search is not repeated.
    search.attempted.clear()
    assert run(recipe_path, folder, "engrave=true", "size_mm=50", resume=True).converged
    assert search.attempted == []
    search.change = stretch
    result = run(recipe_path, folder, "engrave=true", "size_mm=5")
    assert result.status == "off_target"
    assert "; not engraved: label '" in result.message
    assert "die.stl" not in names(folder)


# Checkpoints.


def test_a_resumed_search_ends_like_an_uninterrupted_one(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    whole = run(recipe_path, tmp_path / "whole", "clock=false")
    search.attempted.clear()
    folder = tmp_path / "out"
    for done in (1, 2):
        search.interrupt_after = done
        with pytest.raises(KeyboardInterrupt, match=rf"^{done} of 60 .* --resume"):
            run(recipe_path, folder, resume=done > 1)
        assert names(folder) == ["checkpoint.npz"]
    search.interrupt_after = None
    parts = run(recipe_path, folder, "clock=false", resume=True)
    assert search.attempted == [1, 2, 3]
    assert "checkpoint.npz" not in names(folder)
    assert whole.json_text() == parts.json_text()


def test_a_checkpoint_is_for_its_search_alone(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """Limits, and all entries that do not concern the search, may be others."""
    folder = tmp_path / "out"
    search.interrupt_after = 2
    with pytest.raises(KeyboardInterrupt):
        run(recipe_path, folder)
    before = (folder / "checkpoint.npz").read_bytes()
    for change, kind in (
        ("target={probabilities: [0.5, 0.5]}", "target"),
        ("method.concave={fill: paper, paper: {bending: 1}}", "method"),
        ("start={shape: kitten}", "surface"),
    ):
        with pytest.raises(InputError, match=f"expected a checkpoint of this {kind}, got"):
            run(recipe_path, folder, change, resume=True)
        assert (folder / "checkpoint.npz").read_bytes() == before
        assert names(folder) == ["checkpoint.npz"]
    changes = ["method.concave.attempts=2", "method.concave.displacement=0.1", "size_mm=60"]
    result = run(recipe_path, folder, *changes, resume=True)
    assert result.converged
    assert search.attempted == [1, 2]
    assert result.search.attempts == result.search.attempt == 2


def test_an_interrupt_while_results_are_written_keeps_the_checkpoint(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, replace = tmp_path / "out", os.replace

    def interrupt(partial: Path, path: str) -> None:
        if path.endswith("die_plain.stl"):
            raise KeyboardInterrupt
        replace(partial, path)

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt, match=r"^3 of 60 "):
        run(recipe_path, folder)
    assert "result.json" not in names(folder)
    monkeypatch.setattr(os, "replace", replace)
    search.attempted.clear()
    assert run(recipe_path, folder, resume=True).converged
    assert search.attempted == []


def test_an_interrupt_before_the_first_checkpoint_has_no_message(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    search.interrupt_after = 0
    with pytest.raises(KeyboardInterrupt) as caught:
        run(recipe_path, tmp_path / "out")
    assert str(caught.value) == ""
    assert not (tmp_path / "out").exists()


# From the command line.


def test_the_command_prints_probabilities_and_displacement(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", str(recipe_path), "--out", str(tmp_path / "out")]
    assert main(arguments) == 0
    captured = capsys.readouterr()
    assert captured.err == usual_notes()
    lines = captured.out.splitlines()
    assert lines[0].startswith("cube: The die has your probabilities: off by ")
    assert lines[2].split() == ["label", "target", "die_plain.stl"]
    assert lines[3].split() == ["1", "0.16667", "0.16667"]
    assert lines[9].split() == ["other", "0.0000", "0.0000"]
    assert lines[10] == "displacement: mean 0.371 %, largest 0.866 % of the diagonal"
    assert re.findall(r"[0-9.]+(?= degrees)", lines[11]) == ["90", "45"]
    for option in ("apart_deg=91", "margin_deg=46"):
        assert main([*arguments, "--set", f"method.concave.{option}"]) == 1
        assert option.split("=")[0] in capsys.readouterr().out
    search.leads_nowhere = True
    assert main(arguments) == 1
    assert "\nunchanged: " in capsys.readouterr().out


def test_a_terminal_shows_attempts_limits_and_the_best_die(
    recipe_path: Path,
    tmp_path: Path,
    search: MadeUpSearch,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    arguments = ["run", str(recipe_path), "--out", str(tmp_path / "out")]
    arguments += ["--set", "method.concave.seconds=120", "--set", "method.concave.attempts=7"]
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert main(arguments) == 0
    shown = capsys.readouterr().err
    for done, moved in ((1, "1 %"), (2, "2 %"), (3, "3 %")):
        assert re.search(rf"{done} of 7 attempts, . of 120 s, [^\r]* {moved}", shown)
    assert "0 of 7 attempts, 0 of 120 s" in shown
    assert "too_near" not in shown
    assert main([*arguments, "--set", "method.concave.apart_deg=91"]) == 1
    assert "too_near" in capsys.readouterr().err


def test_an_interrupt_prints_how_to_resume_in_one_line(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", str(recipe_path), "--out", str(tmp_path / "out")]
    search.interrupt_after = 2
    assert main(arguments) == 130
    captured = capsys.readouterr()
    assert captured.out == ""
    assert re.fullmatch(r"dicedesign: interrupted; 2 of 60 .* 2 %.*--resume.*\n", captured.err)
    search.interrupt_after = None
    assert main([*arguments, "--resume"]) == 0
    assert search.attempted == [1, 2, 3]
    capsys.readouterr()
    assert main([*arguments, "--resume"]) == 2
    assert "got none; run without --resume to start" in capsys.readouterr().err


# The surface.


def test_a_surface_is_remeshed_to_a_number_of_points(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text("name: r\ntarget: {fair: 3}\nstart: {shape: knot}\nmethod: concave\n")
    before, after = (
        design_recipe(read_recipe(path, changes), last="start")
        for changes in ([], ["method.concave.points=400"])
    )
    assert before.notes == []
    assert [note.partition(" ")[0] for note in after.notes] == ["decimated"]
    assert 360 < len(after.surface.points) < 560
    assert after.surface.volume == pytest.approx(before.surface.volume, rel=0.03)


def test_repairs_are_noted(recipe_path: Path) -> None:
    mesh = recipe_path.with_suffix(".obj")
    lines = mesh.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("f "))
    a, b, c = lines[first].split()[1:]
    lines[first] = f"f {a} {c} {b}"
    lines.insert(first, "v 9 9 9")
    mesh.write_text("\n".join(lines) + "\n")
    assert design_recipe(read_recipe(recipe_path), last="start").notes == [
        "ignored 1 points that are on no triangle",
        "reversed 1 triangles that were wound against their neighbors",
    ]


# The real search.


@pytest.mark.shipped
def test_a_killed_search_of_a_knot_is_resumed(tmp_path: Path) -> None:
    """Killed while the second checkpoint is written."""
    path = tmp_path / "knot.yaml"
    path.write_text(
        "name: knot\nseed: 2\ntarget: {probabilities: [0.5, 0.3, 0.2]}\nstart: {shape: knot}\n"
        "method: {concave: {points: 300, attempts: 5, displacement: 1e-3, seconds: 600}}\n"
        "figures: false\n"
    )
    whole, parts, steps = tmp_path / "whole", tmp_path / "parts", []
    result = pipeline.run(path, whole, callbacks=Callbacks(on_step=steps.append))
    assert result.converged, result.message
    assert result.search.attempts == 5
    assert result.concave.displacement.mean < 0.05
    assert {step.stage for step in steps} == {"hull", "fill"}
    check(whole)
    kill_at_write(["run", str(path), "--out", str(parts)], 2)
    assert names(parts)[-1] == "checkpoint.npz"
    run(path, parts, resume=True)
    assert (parts / "die_plain.stl").read_bytes() == (whole / "die_plain.stl").read_bytes()


def test_a_hollow_die_has_the_probabilities_by_its_own_center_of_mass(hollow_die: Path) -> None:
    result = read_result(hollow_die)
    for name in ("die_plain.stl", "die.stl"):
        poses = rest_poses(read_body(hollow_die / name))
        own = {facet.label: facet.normal for facet in result.facets}
        downs = np.array([own[label] for label in result.labels])
        probabilities = outcome_probabilities(poses, downs).probabilities
        np.testing.assert_allclose(probabilities, result.target, atol=0.02)
    body = read_body(hollow_die / "die_plain.stl")
    shell = shells_of(body.triangles)
    outer, inner = (Surface(body.points, body.triangles[shell == k]) for k in range(2))
    assert outer.volume > 0.0 > inner.volume
    np.testing.assert_allclose(-inner.volume, result.concave.cavities.volume_mm3, rtol=1e-9)
    # Without the cavity the probabilities would be others.
    assert np.linalg.norm(outer.centroid - rest_poses(body).center_of_mass) > 0.1
    near = distances_from_surface(outer, body.points[np.unique(inner.triangles)]).min()
    assert near >= 1.5 * (1.0 - 1e-4)
