"""The bench of concave dice: cases, figures of what a file holds, failures as rows, the command."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from common.benches import run_bench
from common.bumpy import bumpy_sphere
from common.dented_cube import MadeUpSearch, dented_cube, write_cube

from dicedesign.bench.benches.concave import GOALS, Extent, concave_cases, summary
from dicedesign.bench.bodies.models.random_models import model_names, random_model
from dicedesign.bench.frame import BENCHES
from dicedesign.bench.measures.designs import concave_dice
from dicedesign.bench.measures.designs.concave_dice import (
    ConcaveCase,
    ConcaveRow,
    attempt_concave,
    built_in,
)
from dicedesign.cli.main import main
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.shapes.shapes import SHAPES
from dicedesign.errors import RecipeError
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.recipe.methods import concave as method
from dicedesign.rest.poses import rest_poses

FULL, QUICK = BENCHES["concave"].full, BENCHES["concave"].quick
ONE = Extent(1, ("fair:6",), None, 2000)
GOOD = ConcaveRow(
    "knot", "fair:3", "correspondence", 2496, 11.5, 2e-3, 1e-3, 0, 62.0, 21.5, 0.031, (300, 250), 7
)
NONE = ConcaveRow("cow.obj", "fair:3", "paper", reason="cow.obj: open")


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
    (case,) = concave_cases({path.name: path}, [f"fair:{outcomes}"], QUICK, [fill])
    return case


def test_every_model_meets_every_target_by_every_fill() -> None:
    models = {"a.obj": Path("a.obj"), "blobs_01": None}
    cases = concave_cases(models, ["fair:3", "1/2,1/2"], FULL, ["correspondence", "paper"])
    assert [(case.target, case.model, case.fill) for case in cases] == [
        (target, model, fill)
        for target in ("fair:3", "1/2,1/2")
        for model in ("a.obj", "blobs_01")
        for fill in ("correspondence", "paper")
    ]
    assert {case.most_points for case in cases if case.fill == "paper"} == {2000}
    assert {case.most_points for case in cases if case.fill == "correspondence"} == {None}
    recipe = cases[4].recipe(Path("a.obj"))
    assert recipe.target.target().probabilities.tolist() == [0.5, 0.5]
    with pytest.raises(RecipeError, match=r"^--target fair:1: target: "):
        concave_cases(models, ["fair:1"], QUICK)


def test_options_are_those_of_a_recipe_that_gives_none(cube: Path) -> None:
    plain = replace(case_of(cube), seconds=None)
    assert plain.recipe(cube).method.concave == ConcaveOptions()
    assert replace(plain, seconds=7.0).recipe(cube).method.concave == ConcaveOptions(seconds=7.0)
    paper = replace(plain, fill="paper").recipe(cube).method.concave
    assert (paper.hull, paper.fill) == ("paper", "paper")
    assert set(GOALS) == set(FULL.targets)
    assert FULL.seconds is None


def test_a_cube_is_measured_in_closed_form(cube: Path, search: MadeUpSearch) -> None:
    """Of 14 points, six move by 0.03; the diagonal is 2 sqrt(3). Each triangle keeps its edge of
    length 2 and its height over it goes from sqrt(1.01) to sqrt(1 + 0.13^2)."""
    found = attempt_concave(case_of(cube))
    assert (found.model, found.target, found.fill) == ("cube.obj", "fair:6", "correspondence")
    assert (found.points, found.reason, found.met) == (14, "", True)
    assert found.seconds > 0.0
    assert found.peak_mb is None or found.peak_mb > 10.0
    assert (found.corners, found.attempts) == ((8, 8), 3)
    assert found.intersections == 0
    assert found.error < 1e-6
    assert found.elsewhere == pytest.approx(0.0, abs=1e-12)
    assert found.apart == pytest.approx(90.0, abs=1e-4)
    assert found.margin == pytest.approx(45.0, abs=1e-4)
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
    assert half.reason == "odds off by 1.7e-01; odds of 5.0e-01 elsewhere"
    sides = np.array([1.0, 1.1, 1.3])
    search.change = lambda points: points * sides
    box = attempt_concave(case_of(cube))
    poses = rest_poses(dented_cube().points[:8] * sides, np.zeros(3))
    wanted = np.abs(poses.probabilities - 1.0 / 6.0).max()
    assert wanted > 0.02
    assert box.error == pytest.approx(wanted, abs=1e-6)
    assert box.margin == pytest.approx(np.degrees(np.arctan(1.0 / 1.3)), abs=1e-4)
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
    assert row.reason == f"{row.intersections} pairs of triangles meet"


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
    assert small.note != ""
    left = attempt_concave(case_of(path, 3))
    assert left.points == asked[1] == 642
    assert (left.reason, left.error, left.met) == ("ZeroDivisionError: no die", None, False)


def test_models_that_the_package_makes_are_read_from_files(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    surfaces: list[Surface] = []

    def find(surface: Surface, *given: object, **more: object) -> None:
        surfaces.append(surface)
        raise ZeroDivisionError("no die")

    monkeypatch.setattr(method, "make_concave_die", find)
    for name, wanted in (("knot", SHAPES["knot"]()), ("star_02", random_model("star_02"))):
        (case,) = concave_cases({name: None}, ["fair:3"], QUICK)
        assert attempt_concave(case).points == len(wanted.points)
        assert surfaces[-1].volume == pytest.approx(wanted.volume, rel=1e-5)
    assert built_in("knot")
    assert built_in("blobs_12")
    assert not built_in("blobs")


def test_failures_are_rows(tmp_path: Path, cube: Path) -> None:
    opened = tmp_path / "open.obj"
    opened.write_text("".join(cube.read_text().splitlines(keepends=True)[:-1]))
    row = attempt_concave(case_of(opened))
    assert (row.points, row.error, row.seconds, row.met) == (None, None, None, False)
    assert "open.obj: expected a closed surface" in row.reason
    many = attempt_concave(case_of(cube, 13))
    assert (many.points, many.error) == (14, None)
    assert many.reason.startswith("target: expected at most 12 outcomes for a hull of 8 corners")


def test_a_die_has_to_be_good_in_every_way() -> None:
    assert GOOD.judged(5e-3).met
    limits = {"error": 5e-3, "elsewhere": 5e-3, "apart": 45.0, "margin": 10.0, "seconds": 60.0}
    assert replace(GOOD, **limits).judged(5e-3).met
    for change, reason in (
        ({"error": 6e-3}, "odds off by 6.0e-03"),
        ({"elsewhere": 6e-3}, "odds of 6.0e-03 elsewhere"),
        ({"intersections": 1}, "1 pairs of triangles meet"),
        ({"apart": 44.9}, "outcomes 44.9 degrees apart"),
        ({"margin": 9.9}, "an outcome is left at 9.9 degrees"),
        ({"seconds": 61.0}, "took 61 s"),
    ):
        assert replace(GOOD, **change).judged(5e-3).reason == reason


def test_rows_as_text() -> None:
    measured = ["2.0e-03", "1.0e-03", "0", "62.0", "21.5", "3.10", "300/250"]
    assert GOOD.line().split()[3:] == ["2496", "11.5", *measured, "7", "met"]
    assert NONE.line().split()[:4] == ["cow.obj", "fair:3", "paper", "-"]
    assert NONE.line().endswith("  cow.obj: open")


def test_a_summary_counts_by_target_and_fill() -> None:
    """Of eleven dice that took 1 to 11 s, the first ten as wanted."""
    rows = [
        replace(GOOD, seconds=second, mean_displacement=0.01 * second, reason="" * (second < 11))
        for second in range(1, 12)
    ]
    rows[-1] = replace(rows[-1], reason="took long")
    good, paper = summary([*rows, NONE])
    assert (good.target, good.fill, good.dice) == ("fair:3", "correspondence", 11)
    assert good.share == pytest.approx(10.0 / 11.0)
    assert (good.goal, good.reached) == (0.9, True)
    assert (good.median_seconds, good.late_seconds, good.most_seconds) == (6.0, 10.0, 11.0)
    assert good.displacement == pytest.approx(0.055)
    assert not replace(good, share=0.89).reached
    assert (paper.share, paper.goal, paper.displacement, paper.reached) == (0.0, None, None, True)
    assert paper.most_seconds is None


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["gone.obj"], "gone.obj: expected a mesh file, got none"),
        (["--models", "gone"], "gone"),
        (["--model", "swan"], "--model: expected a model that the package makes, got 'swan'"),
        (["--random", "0"], "--random: expected at least 1, got 0"),
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


def models_of(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: object
) -> list[str]:
    """What the command makes into dice, and with how many threads."""

    def attempt(case: ConcaveCase) -> ConcaveRow:
        assert os.environ["OMP_NUM_THREADS"] == os.environ["OPENBLAS_NUM_THREADS"] == "1"
        return ConcaveRow(case.model, case.target, case.fill)

    monkeypatch.setattr("dicedesign.bench.benches.concave.attempt_concave", attempt)
    extent = replace(ONE, random=3)
    assert run_bench("concave", *words, "--json", extent=extent) == 0
    return [row["model"] for row in json.loads(capsys.readouterr().out)["rows"]]


def test_models_come_from_a_folder_by_name_or_at_random(
    cube: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("b.stl", "a.ply", "notes.txt"):
        (cube.parent / name).write_bytes(b"")
    asked = (monkeypatch, capsys)
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert models_of(*asked) == list(model_names(3))
    assert models_of(*asked, "--random", 12) == list(model_names(12))
    folder = ["a.ply", "b.stl", "cube.obj"]
    assert models_of(*asked, "--models", cube.parent) == folder
    assert models_of(*asked, "--models", cube.parent, "--random", 1) == [*folder, "blobs_01"]
    words = ("--model", "toy_07", "--model", "kitten")
    assert models_of(*asked, cube, *words) == ["cube.obj", "toy_07", "kitten"]
    assert os.environ["OMP_NUM_THREADS"] == "2"
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_a_cube_goes_through_the_command(
    cube: Path,
    search: MadeUpSearch,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run_bench("concave", cube, "--fill", "both", "--json", extent=ONE) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    first, second = found["rows"]
    assert (first["fill"], second["fill"]) == ("correspondence", "paper")
    assert first["met"]
    assert first["mean_displacement"] == second["mean_displacement"] > 0.0
    assert [target["share"] for target in found["targets"]] == [1.0, 1.0]
    words = ("concave", cube, "--target", "fair:4", "--target", "fair:6")
    assert run_bench(*words, extent=ONE) == 1
    out = capsys.readouterr().out
    assert "not as wanted for fair:4 by correspondence:\ncube.obj: odds off by" in out
    assert "not as wanted for fair:6" not in out
    monkeypatch.setattr(concave_dice, "LONGEST", 0.0)
    assert run_bench("concave", cube, extent=ONE) == 0
    assert "cube.obj: took 0 s" in capsys.readouterr().out


def test_of_few_dice_half_must_be_as_wanted() -> None:
    rows = [replace(GOOD, model="one"), replace(GOOD, model="two"), replace(GOOD, reason="odds")]
    (two,), (one,) = summary(rows), summary([rows[0], rows[2], rows[2]])
    assert (two.share, two.reached) == (pytest.approx(2.0 / 3.0), True)
    assert not one.reached
