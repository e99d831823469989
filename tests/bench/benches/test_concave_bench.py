"""The bench of concave dice: cases, figures of what a file holds, failures as rows, the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from common.benches import run_bench
from common.bumpy import bumpy_sphere
from common.dented_cube import MadeUpSearch, dented_cube, write_cube

from dicedesign.bench.benches.concave import (
    ConcaveCase,
    ConcaveRow,
    Extent,
    attempt_concave,
    concave_cases,
    verdict,
)
from dicedesign.bench.frame import BENCHES
from dicedesign.cli.main import main
from dicedesign.concave.shapes.shapes import SHAPES
from dicedesign.errors import RecipeError
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.recipe.methods import concave as method
from dicedesign.rest.poses import rest_poses

FULL, QUICK = BENCHES["concave"].full, BENCHES["concave"].quick
GOOD = ConcaveRow(
    "knot", "fair:3", "correspondence", 2496, 11.5, 400.2, 2e-3, 1e-3, 1e-9, 0, 0.031, 0.12, 1.25,
    1.5, (300, 250), 7, "", 5e-3,
)  # fmt: skip
NONE = ConcaveRow("cow.obj", "fair:3", "paper", note="cow.obj: open", tolerance=5e-3)


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> MadeUpSearch:
    """Takes the place of the real one: a cube whose dents become deeper by 0.03 of 2."""
    made_up = MadeUpSearch()
    monkeypatch.setattr(method, "make_concave_die", made_up)
    return made_up


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    path = tmp_path / "cube.obj"
    write_cube(path)
    return path


def case_of(path: Path, outcomes: int = 6, fill: str = "correspondence") -> ConcaveCase:
    (case,) = concave_cases([path], {"fair": {"fair": outcomes}}, QUICK, [fill])
    return case


def test_every_mesh_meets_every_target_by_every_fill() -> None:
    targets: dict[str, dict[str, Any]] = {
        "fair:3": {"fair": 3},
        "1/2,1/2": {"probabilities": ["1/2", "1/2"]},
    }
    cases = concave_cases([Path("a.obj"), Path("b.stl"), Path("other/a.obj")], targets, FULL)
    assert [(case.model, case.target, case.fill) for case in cases] == [
        (model, target, fill)
        for model in ("a.obj", "b.stl", "a.obj")
        for target in targets
        for fill in ("correspondence", "paper")
    ]
    assert {case.most_points for case in cases if case.fill == "paper"} == {2000}
    assert {case.most_points for case in cases if case.fill == "correspondence"} == {None}
    assert cases[2].recipe.target.target().probabilities.tolist() == [0.5, 0.5]
    for extent in (FULL, QUICK):
        own = concave_cases([], {"fair:3": {"fair": 3}}, extent, ["paper"])
        assert [case.model for case in own] == list(extent.shapes)
        assert set(extent.shapes) <= set(SHAPES)
        assert {case.recipe.method.concave.seconds for case in own} == {extent.seconds}
    with pytest.raises(RecipeError, match=r"^--target fair:1: target: "):
        concave_cases([], {"fair:1": {"fair": 1}}, QUICK)


def test_a_cube_is_measured_in_closed_form(cube: Path, search: MadeUpSearch) -> None:
    """Of 14 points, six move by 0.03; the diagonal is 2 sqrt(3). Each triangle keeps its edge of
    length 2 and its height over it goes from sqrt(1.01) to sqrt(1 + 0.13^2)."""
    steps: list[int] = []
    row = attempt_concave(case_of(cube), lambda step: steps.append(step.attempt))
    assert (row.model, row.target, row.fill) == ("cube.obj", "fair", "correspondence")
    assert (row.points, row.note, row.tolerance, row.met) == (14, "", 5e-3, True)
    assert steps == [1, 1, 2, 2, 3, 3]
    assert row.seconds > 0.0
    assert row.peak_mb is None or row.peak_mb > 10.0
    found = row
    assert (found.corners, found.attempts) == ((8, 8), 3)
    assert found.intersections == 0
    assert found.error < 1e-6
    assert found.elsewhere == pytest.approx(0.0, abs=1e-12)
    assert found.gap < 1e-6
    assert found.largest_displacement == pytest.approx(0.03 / np.sqrt(12.0))
    assert found.mean_displacement == pytest.approx(6.0 / 14.0 * 0.03 / np.sqrt(12.0))
    assert found.shape_distortion == pytest.approx(np.sqrt(1.0169 / 1.01), rel=1e-9)
    assert found.size_distortion == pytest.approx(1.0, rel=1e-9)


def test_odds_are_those_of_the_file_and_not_of_the_search(cube: Path, search: MadeUpSearch) -> None:
    """The search claims an error of 0; three of six sides hold half of the odds, and a box of other
    sides holds what the forward model says of its corners."""
    half = attempt_concave(case_of(cube, 3))
    assert half.error == pytest.approx(1.0 / 6.0, abs=1e-6)
    assert half.elsewhere == pytest.approx(0.5, abs=1e-6)
    assert not half.met
    sides = np.array([1.0, 1.1, 1.3])
    search.change = lambda points: points * sides
    box = attempt_concave(case_of(cube))
    poses = rest_poses(dented_cube().points[:8] * sides, np.zeros(3))
    wanted = np.abs(poses.probabilities - 1.0 / 6.0).max()
    assert wanted > 0.02
    assert box.error == pytest.approx(wanted, abs=1e-6)
    # The search says that the hull is still the cube.
    assert box.gap == pytest.approx(0.3 / np.linalg.norm(2.0 * sides), abs=1e-6)
    assert not box.met


def test_a_die_that_meets_itself_is_not_as_wanted(cube: Path, search: MadeUpSearch) -> None:
    def through(points: np.ndarray) -> np.ndarray:
        """Opposite dents are pushed past each other."""
        moved = points.copy()
        moved[8], moved[11] = (-0.3, 0.0, 0.0), (0.3, 0.0, 0.0)
        return moved

    search.change = through
    row = attempt_concave(case_of(cube))
    assert row.intersections is not None
    assert row.intersections > 0
    assert not row.met


def test_only_large_surfaces_are_decimated_for_the_paper(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("fast_simplification")
    asked: list[int] = []

    def find(surface: Surface, *given: object, **more: object) -> None:
        asked.append(len(surface.points))
        raise ZeroDivisionError("no die")

    monkeypatch.setattr(method, "make_concave_die", find)
    path = tmp_path / "bumpy.obj"
    bumpy = bumpy_sphere(3)
    trimesh.Trimesh(bumpy.points, bumpy.triangles, process=False).export(path)
    small = attempt_concave(replace(case_of(path, 3, "paper"), most_points=200))
    assert small.points == asked[0] <= 200
    assert small.fill == "paper"
    left = attempt_concave(case_of(path, 3))
    assert left.points == asked[1] == 642
    assert (left.note, left.error, left.met) == ("ZeroDivisionError: no die", None, False)


def test_failures_are_rows(tmp_path: Path, cube: Path) -> None:
    opened = tmp_path / "open.obj"
    opened.write_text("".join(cube.read_text().splitlines(keepends=True)[:-1]))
    row = attempt_concave(case_of(opened))
    assert (row.points, row.error, row.seconds, row.met) == (None, None, 0.0, False)
    assert "open.obj: expected a closed surface" in row.note
    many = attempt_concave(case_of(cube, 13))
    assert (many.points, many.error) == (14, None)
    assert many.note.startswith("target: expected at most 12 outcomes for a hull of 8 corners")


def test_rows_and_verdict() -> None:
    measured = ["2.0e-03", "1.0e-03", "1.0e-09", "0", "3.10", "12.0", "1.25", "1.50", "300/250"]
    assert GOOD.line().split()[3:] == ["2496", "11.5", "400", *measured, "7"]
    assert NONE.line().split()[:4] == ["cow.obj", "fair:3", "paper", "-"]
    assert NONE.line().endswith("  cow.obj: open")
    good, none = verdict([GOOD, NONE])
    assert good == "by correspondence: 1 of 1 as wanted"
    assert none.startswith("by paper: 0 of 1 as wanted; beyond 0.005, or meeting itself: ")
    for change in ({"error": 6e-3}, {"elsewhere": 6e-3}, {"intersections": 1}, {"error": None}):
        assert not replace(GOOD, **change).met


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["gone.obj"], "gone.obj: expected a mesh file, got none"),
        (["--target", "fair:x"], "--target: expected fair:K or probabilities, got 'fair:x'"),
        (["--target", "dice:6"], "--target: expected fair:K or probabilities, got 'dice:6'"),
        (["--target", "fair:1"], "--target fair:1: target: "),
        (["--target", "1/2,1/3"], "--target 1/2,1/3: target: probabilities: expected a sum of 1"),
    ],
)
def test_bad_arguments_are_errors_in_words(
    words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "concave", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert text in err


def test_a_cube_goes_through_the_command(
    cube: Path, search: MadeUpSearch, capsys: pytest.CaptureFixture[str]
) -> None:
    extent = Extent((), 2000, 60.0)
    assert run_bench("concave", cube, "--target", "fair:6", "--json", extent=extent) == 0
    first, second = json.loads(capsys.readouterr().out)["rows"]
    assert (first["fill"], second["fill"]) == ("correspondence", "paper")
    assert first["met"]
    assert first["mean_displacement"] == second["mean_displacement"] > 0.0
    words = ["concave", cube, "--target", "1/2,1/6,1/6,1/6", "--fill", "correspondence"]
    assert run_bench(*words, extent=extent) == 1
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.endswith("or meeting itself: cube.obj, 1/2,1/6,1/6,1/6")
