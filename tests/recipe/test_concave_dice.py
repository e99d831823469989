"""Recipes of concave dice from file to folder: verdicts, results and checkpoints with a replaced
search, and real searches."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from check_outputs import check
from common.dented_cube import NORMALS, MadeUpSearch, write_cube
from common.finished import finished_result
from common.processes import kill_at_write

from dicedesign import rest_poses
from dicedesign.cli.main import main
from dicedesign.concave.result import Hollow
from dicedesign.errors import InputError, LabelRoomError
from dicedesign.geometry.meshes.body import Body, shells_of
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe import pipeline
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Callbacks, Work
from dicedesign.recipe.reading import read_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.results.folder import read_result, write_results
from dicedesign.results.parts import Status
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.checkpoint import checkpoint_bytes

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

BOX = np.array([1.0, 1.1, 1.25])
"""Stretch that makes a box of the cube."""


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


def stretch(points: Floats) -> Floats:
    return points * BOX


def run(path: Path, folder: Path, *changes: str, resume: bool = False) -> Result:
    return pipeline.run(path, folder, changes=changes, resume=resume)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_the_folder_of_a_die_with_labels(concave_die: Path) -> None:
    """Of a real search, with all figures."""
    summary = check(concave_die)
    assert summary["status"] == "converged"
    files = PICTURES | {"die", "die_plain", "recipe", "report", "result", "reading"}
    assert set(summary["files"]) == files


def test_a_recipe_becomes_a_die(recipe_path: Path, tmp_path: Path, search: MadeUpSearch) -> None:
    """In a folder of an earlier run, whose files are removed."""
    folder = tmp_path / "out"
    folder.mkdir()
    files = dict.fromkeys(["gauss_map.png", "die.stl"], b"of an earlier run")
    write_results(folder, files, finished_result(["a"], [1.0]))
    (folder / "checkpoint.npz").write_bytes(checkpoint_bytes({"seed": "1"}, {}, {}))
    (folder / "mine").touch()
    stages: list[str] = []
    steps: list[tuple[int, str]] = []
    recipe = read_recipe(recipe_path)
    callbacks = Callbacks(stages.append, lambda step: steps.append((step.attempt, step.stage)))
    result = pipeline.run(recipe, folder, callbacks=callbacks)
    assert result.converged
    assert names(folder) == sorted(["mine", *result.files.values()])
    assert read_result(folder) == result
    assert read_recipe(folder / "recipe.yaml") == recipe
    assert steps == [(k, stage) for k in (1, 2, 3) for stage in ("hull", "fill")]
    assert [stage.name for stage in result.stages] == stages
    # The dents went from 0.1 to 0.13 in 6 of 14 points, where the side is 2.
    assert result.concave.displacement.largest == pytest.approx(0.03 / np.sqrt(12.0))
    assert result.concave.displacement.mean == pytest.approx(6 / 14 * 0.03 / np.sqrt(12.0))
    assert result.concave.hull.gap < 1e-6


# Verdicts.


def design(path: Path, *changes: str) -> Work:
    """Run a recipe up to the check."""
    return design_recipe(read_recipe(path, changes), last="check")


def test_the_verdict_is_that_of_the_file(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """The search reports success, but the die is a box."""
    search.change = stretch
    result = run(recipe_path, tmp_path / "out")
    assert result.status == "off_target"
    poses = rest_poses(trimesh.load_mesh(result.folder / "die_plain.stl"))
    probabilities = outcome_probabilities(poses, NORMALS).probabilities
    np.testing.assert_allclose(result.probabilities, probabilities, atol=1e-12)
    assert result.max_abs_error == pytest.approx(np.abs(probabilities - 1 / 6).max(), abs=1e-12)
    assert result.max_abs_error > 0.02
    for status in (Status.OFF_TARGET, Status.LOOSE):
        assert status.value in result.message
    # The replaced search makes three attempts, and reports 1.8 s.
    for limit, value in (("attempts", 3), ("seconds", 1.5)):
        work = design(recipe_path, f"method.concave.{limit}={value}")
        assert f"method.concave.{limit}" in "; ".join(work.remarks)


@pytest.mark.parametrize("sides", [tuple(BOX), (1.0, 0.9, 0.75), (1.0, 1.0, 1.0)])
def test_the_gap_is_the_distance_between_hulls_over_the_diagonal(
    sides: tuple[float, float, float], recipe_path: Path, search: MadeUpSearch
) -> None:
    """The designed hull is a cube; the surface is larger or smaller."""
    search.change = lambda points: points * sides
    work = design(recipe_path)
    x, y, z = sides
    apart = max(z - 1.0, float(np.hypot(1.0 - y, 1.0 - z)) if z < 1.0 else 0.0)
    expected = apart / (2.0 * np.sqrt(x * x + y * y + z * z))
    assert work.concave.hull.gap == pytest.approx(expected, rel=1e-5, abs=1e-7)
    assert (Status.LOOSE.value in "; ".join(work.remarks)) == (apart > 0.0)
    np.testing.assert_allclose(work.concave.probabilities_before, 1.0 / 6.0, atol=1e-12)


def test_a_die_whose_prints_miss_is_fragile(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    within = "method.concave.prints_within=1e-4"
    result = run(recipe_path, tmp_path / "out", within, "print=true")
    assert result.status == "fragile"
    assert result.max_abs_error < 1e-6
    assert result.tolerances.total_variation > 1e-4
    assert all(draft.prints > 1e-4 for draft in result.search.trade_off.drafts)
    assert run(recipe_path, tmp_path / "plain", within).converged


def test_a_failed_search_keeps_the_surface(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """The target has more outcomes than the cube has sides."""
    search.leads_nowhere = True
    result = run(recipe_path, tmp_path / "out", "target={fair: 9}", "engrave=true")
    assert result.status == "unchanged"
    assert (result.search.attempts, result.search.attempt) == (3, None)
    assert (result.concave.displacement.mean, result.concave.displacement.largest) == (0.0, 0.0)
    np.testing.assert_allclose(result.probabilities, [1 / 6] * 6 + [0.0] * 3, atol=1e-7)
    np.testing.assert_allclose(result.probabilities, result.concave.probabilities_before, atol=1e-7)
    assert result.rest_counts == (1,) * 6 + (0,) * 3
    assert "die" not in result.files


@pytest.mark.parametrize("figures", ["false", pytest.param("true", marks=pytest.mark.full)])
def test_a_self_intersecting_surface_is_a_flaw(
    figures: str, recipe_path: Path, tmp_path: Path, search: MadeUpSearch
) -> None:
    """Two opposite dents are so deep that they intersect."""

    def push(points: Floats) -> Floats:
        deep = points.copy()
        deep[[8, 11], 0] *= -0.5
        return deep

    search.change = push
    result = run(recipe_path, tmp_path / "out", f"figures={figures}")
    assert result.status == "self_intersecting"
    assert result.concave.self_intersections > 0
    assert ("crossings" in result.files) == (figures == "true")


@pytest.mark.parametrize(
    ("option", "angle", "status"),
    [("apart_deg", 90.0, Status.TOO_NEAR), ("margin_deg", 45.0, Status.TIPPY)],
)
def test_small_angles_are_flaws(
    option: str, angle: float, status: Status, recipe_path: Path, search: MadeUpSearch
) -> None:
    """The sides of a cube are 90 degrees apart, and it tips over an edge at 45 degrees."""
    key = f"method.concave.{option}"
    assert design(recipe_path, f"{key}={angle}").status is Status.CONVERGED
    work = design(recipe_path, f"{key}={angle + 0.3}")
    assert work.status is status
    assert key in "; ".join(work.remarks)


def test_angles_of_a_sheared_cube(recipe_path: Path, search: MadeUpSearch) -> None:
    """By 3 : 10; its sides 1 and 3 have outward normals x and z."""
    search.change = lambda points: points + np.outer(points[:, 2], [0.3, 0.0, 0.0])
    work = design(recipe_path, "method.concave.apart_deg=80", "method.concave.margin_deg=40")
    message = "; ".join(work.remarks)
    # Normals of the sheared sides are (1, 0, -0.3) and (0, 0, 1), and those opposite.
    apart = np.degrees(np.arctan2(1.0, 0.3))
    assert work.plain.outcomes.least_angle == pytest.approx(np.radians(apart), abs=1e-6)
    assert sum(pair in message for pair in ("1 and 6", "3 and 4")) == 1
    # From (0, 0, -1) over the lower edge at (-1.3, 0, -1), beyond the center of mass by 0.7.
    left = np.degrees(np.arctan2(0.7, 1.0))
    assert np.degrees(work.plain.margins)[[2, 5]] == pytest.approx(left, abs=1e-4)
    for label in ("3", "6"):
        assert f"{label} tips over at {left:.3g} degrees" in message


def test_marks_that_do_not_fit(recipe_path: Path, tmp_path: Path, search: MadeUpSearch) -> None:
    """An error for a converged die, else a remark; a note if the size was left to the run."""
    folder = tmp_path / "out"
    with pytest.raises(LabelRoomError):
        run(recipe_path, folder, "engrave=true", "size_mm=5")
    assert names(folder) == ["checkpoint.npz"]
    changes = ("engrave.depth_mm=15",)
    result = pipeline.run(recipe_path, tmp_path / "free", changes=changes, enlarge=True)
    assert result.converged
    assert "die.stl" not in names(tmp_path / "free")
    assert any("reduce depth_mm" in note for note in result.notes)
    # The search is not repeated.
    search.attempted.clear()
    assert run(recipe_path, folder, resume=True).converged
    assert search.attempted == []
    search.change = stretch
    result = run(recipe_path, folder, "engrave=true", "size_mm=5")
    assert result.status == "off_target"
    assert "die.stl" not in names(folder)


@pytest.mark.parametrize(
    ("labels", "is_enlarged"), [("abcdef", False), (["incomprehensible", *"bcdef"], True)]
)
def test_labels_of_a_mesh_are_engraved(
    labels: Sequence[str], is_enlarged: bool, tmp_path: Path, search: MadeUpSearch
) -> None:
    """The die is enlarged if they need it."""
    write_cube(tmp_path / "cube.obj")
    command = ["design", "d6", "--mesh", str(tmp_path / "cube.obj"), "--labels", ",".join(labels)]
    assert main([*command, "--no-figures", "--out", str(tmp_path / "out")]) == 0
    assert (read_recipe(tmp_path / "out" / "recipe.yaml").size_mm > 30.0) == is_enlarged
    plain, marked = (read_body(tmp_path / "out" / f"{stem}.stl") for stem in ("die_plain", "die"))
    assert len(marked.points) > len(plain.points)


@pytest.mark.parametrize(
    ("target", "scale", "words"),
    [
        ("{fair: 6}", 1.0, []),
        ("{fair: 6}", 0.01, ["meters"]),
        ("{probabilities: [0.95, 0.0499, 1e-4]}", 1.0, ["needle", "10,000 throws"]),
        ("{probabilities: [0.5, 0.4999, 1e-4]}", 1.0, ["10,000 throws"]),
    ],
)
def test_notes_on_what_may_surprise(
    target: str, scale: float, words: list[str], recipe_path: Path
) -> None:
    mesh = recipe_path.with_name("cube.obj")
    cube = trimesh.load(mesh, process=False)
    cube.apply_scale(scale).export(mesh)
    notes = design_recipe(read_recipe(recipe_path, [f"target={target}"]), last="start").notes
    assert len(notes) == len(words)
    assert all(word in note for word, note in zip(words, notes, strict=True))


# Checkpoints.


def test_a_resumed_search_ends_like_an_uninterrupted_one(
    recipe_path: Path, tmp_path: Path, search: MadeUpSearch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the command line, whose exit codes and streams say what happened."""
    folder = tmp_path / "out"

    def command(*options: str) -> int:
        return main(["run", str(recipe_path), "--out", str(folder), "--no-clock", *options])

    whole = run(recipe_path, tmp_path / "whole", "clock=false")
    search.attempted.clear()
    search.interrupt_after = 0
    assert command() == 130
    assert not folder.exists()
    for done in (1, 2):
        search.interrupt_after = done
        assert command(*["--resume"][: done - 1]) == 130
        captured = capsys.readouterr()
        assert captured.out == ""
        assert "--resume" in captured.err
        assert names(folder) == ["checkpoint.npz"]
    search.interrupt_after = None
    assert command("--resume") == 0
    assert "displacement" in capsys.readouterr().out
    assert search.attempted == [1, 2, 3]
    assert "checkpoint.npz" not in names(folder)
    assert whole.json_text() == read_result(folder).json_text()
    assert command("--resume") == 2
    search.leads_nowhere = True
    assert command() == 1


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
        with pytest.raises(InputError, match=f"checkpoint of this {kind}"):
            run(recipe_path, folder, change, resume=True)
        assert (folder / "checkpoint.npz").read_bytes() == before
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
    with pytest.raises(KeyboardInterrupt):
        run(recipe_path, folder)
    assert "result.json" not in names(folder)
    monkeypatch.setattr(os, "replace", replace)
    search.attempted.clear()
    assert run(recipe_path, folder, resume=True).converged
    assert search.attempted == []


# The surface.


def test_a_surface_is_remeshed_to_a_number_of_points(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text("name: r\ntarget: {fair: 3}\nstart: {shape: knot}\nmethod: concave\n")
    before, after = (
        design_recipe(read_recipe(path, changes), last="start")
        for changes in ([], ["method.concave.points=400"])
    )
    assert (len(before.notes), len(after.notes)) == (0, 1)
    assert 360 < len(after.surface.points) < 560
    assert after.surface.volume == pytest.approx(before.surface.volume, rel=0.03)


@pytest.mark.shipped
def test_a_killed_search_of_a_knot_is_resumed(tmp_path: Path) -> None:
    """Killed while the second checkpoint is written."""
    path = tmp_path / "knot.yaml"
    path.write_text(
        "name: knot\nseed: 2\ntarget: {probabilities: [0.5, 0.3, 0.2]}\nstart: {shape: knot}\n"
        "method: {concave: {points: 300, attempts: 5, displacement: 1e-3, seconds: 600}}\n"
        "figures: false\n"
    )
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    result = run(path, whole)
    assert result.converged, result.message
    assert result.search.attempts == 5
    assert result.concave.displacement.mean < 0.05
    check(whole)
    kill_at_write(["run", str(path), "--out", str(parts)], 2)
    assert names(parts)[-1] == "checkpoint.npz"
    run(path, parts, resume=True)
    assert (parts / "die_plain.stl").read_bytes() == (whole / "die_plain.stl").read_bytes()


# Hollow dice.


def outer_and_inner(body: Body) -> tuple[Surface, Surface]:
    """Outside and cavity of a body in two shells."""
    shell = shells_of(body.triangles)
    shells = [Surface(body.points, body.triangles[shell == k]) for k in range(2)]
    outer, inner = sorted(shells, key=lambda each: -each.volume)
    assert outer.volume > 0.0 > inner.volume
    return outer, inner


def wall_between(one: Surface, other: Surface) -> float:
    """Least distance of the points of each surface from the other surface."""
    pairs = ((one, other), (other, one))
    return min(distances_from_surface(a, b.points[np.unique(b.triangles)]).min() for a, b in pairs)


def test_files_of_a_hollow_die(hollow_die: Path) -> None:
    """They have the probabilities by their own centers of mass, and walls as reported."""
    result = read_result(hollow_die)
    cavities, normals = result.concave.cavities, {f.label: f.normal for f in result.facets}
    downs = np.array([normals[label] for label in result.labels])
    for name, wall in (("die_plain", cavities.wall_mm), ("die", cavities.marked_wall_mm)):
        body = read_body(hollow_die / f"{name}.stl")
        poses = rest_poses(body)
        probabilities = outcome_probabilities(poses, downs).probabilities
        np.testing.assert_allclose(probabilities, result.target, atol=0.02)
        outer, inner = outer_and_inner(body)
        np.testing.assert_allclose(-inner.volume, cavities.volume_mm3, rtol=1e-6)
        # Without the cavity the probabilities would be others.
        assert norms(outer.centroid - poses.center_of_mass) > 0.1
        assert wall_between(outer, inner) == pytest.approx(wall, rel=0.02)
    assert cavities.wall_mm >= 1.5 * (1.0 - 1e-4)


def test_thin_walls_between_marks_and_cavity_are_noted(
    recipe_path: Path, search: MadeUpSearch
) -> None:
    """The printer makes walls of 0.8 mm."""
    search.hollow = Hollow(1.2 / 40.0, np.array([0.02, 0.01, 0.0]))
    changes = [
        "method.concave={tolerance: 0.05, hollow: {wall_mm: 1.2}}",
        "engrave={depth_mm: 0.6, balance: none, blank: ['2', '3', '4', '5', '6']}",
        "print=true",
    ]
    work = design_recipe(read_recipe(recipe_path, changes), last="engrave")
    assert work.concave.cavities.marked_wall_mm == pytest.approx(1.2 - 0.6, rel=0.05)
    assert any("method.concave.hollow.wall_mm" in note for note in work.notes)
