"""The bench that compares methods of design, and what it writes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from dicedesign.recipe.design_stage import make_start
from PIL import Image

from dicedesign import rest_poses
from dicedesign.bench.design import METHODS, Run, methods_figure, methods_record, run_method
from dicedesign.cli.main import main
from dicedesign.design.preferences.weights import Preferences
from dicedesign.design.solvers.exact import ExactOptions
from dicedesign.errors import OutputError
from dicedesign.recipe.schema.reading import read_recipe
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.status import Status

RECIPE = """
name: tiny
target: {probabilities: [0.3, 0.3, 0.4]}
start: {prism: {}}
method: {descent: {stopping: {tolerance: 1e-2}, weights: {coplanar: 0.3}}}
"""


@pytest.fixture
def recipe_path(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(RECIPE)
    return path


@pytest.fixture
def recipe(recipe_path: Path) -> Recipe:
    return read_recipe(recipe_path)


def test_methods_differ_in_what_their_names_say_and_in_nothing_else(recipe: Recipe) -> None:
    assert len({method.name for method in METHODS}) == len(METHODS)
    own = recipe.method.descent
    seen = set()
    for method in METHODS:
        changed = method.set_up(recipe)
        options = changed.method.descent
        assert changed.model_copy(update={"method": recipe.method}) == recipe
        seen.add(repr(changed.method))
        if method.name == "exact":
            assert changed.method.exact == ExactOptions(prefer=Preferences())
            continue
        assert options.stopping == own.stopping
        assert options.weights.coplanar == 0.3
        assert options.coordinates == ("facets" if method.name == "facets" else "vertices")
        power = None if options.sobolev is None else options.sobolev.power
        assert power == (int(method.name[-1]) if "Sobolev" in method.name else None)
        expected = 0.0 if method.name.startswith("paper") else own.weights.stability
        assert options.weights.stability == expected
    assert len(seen) == len(METHODS)


def test_a_run_records_every_step_and_the_finished_die(recipe: Recipe) -> None:
    start = make_start(recipe)
    steps = []
    run = run_method(recipe, start, METHODS[0], 20.0, steps.append)
    assert run.status == "CONVERGED"
    assert run.errors[-1] <= run.tolerance == 1e-2
    assert run.steps == len(steps) - 1 == len(run.errors) - 1 == len(run.energies) - 1
    assert run.evaluations > run.steps
    assert run.hulls_built >= 1
    # The dice energy of three outcomes lies between one and three squares of the largest error.
    for error, energy in zip(run.errors, run.energies, strict=True):
        assert error**2 <= energy * (1 + 1e-9) + 1e-30
        assert energy <= 3.0 * error**2 + 1e-30
    # The first error is that of the start, but for its perturbation of a thousandth.
    poses = rest_poses(start.points)
    first = np.abs(poses.probabilities - np.array([1.0, 1.0, 1.0]) / 3.0).max()
    assert first < 1e-9
    assert run.errors[0] == pytest.approx(0.4 - 1.0 / 3.0, abs=5e-3)
    assert run.die_error == pytest.approx(run.errors[-1], abs=1e-9)


def made(**changes: object) -> Run:
    values: dict = {
        "recipe": "r",
        "method": "m",
        "tolerance": 1e-3,
        "status": "CONVERGED",
        "evaluations": 5,
        "hulls_built": 2,
        "hulls_reused": 3,
        "die_error": 1e-4,
        "seconds": (0.05, 0.2, 0.5, 2.0),
        "errors": (0.3, 0.4, 0.1, 1e-4),
        "energies": (0.1, 0.2, 0.01, 0.0),
    }
    return Run(**(values | changes))


@pytest.mark.parametrize(
    ("seconds", "error"), [(0.01, 0.3), (0.2, 0.3), (0.49, 0.3), (0.5, 0.1), (9.0, 1e-4)]
)
def test_the_error_after_some_time_is_the_smallest_so_far(seconds: float, error: float) -> None:
    assert made().error_after(seconds) == error


def test_the_figure_has_a_row_for_each_recipe() -> None:
    paper = methods_figure([made(), made(method="n", status="NO_PROGRESS"), made(recipe="other")])
    assert {"r: error, max |p − q|", "other: dice energy", "m", "n"} <= set(paper.texts)
    assert paper.width == 1500


def test_the_record_is_plain_data() -> None:
    record = methods_record([made()], 15.0)
    again = json.loads(json.dumps(record, allow_nan=False))
    assert again["limit_seconds"] == 15.0
    assert again["runs"][0]["errors"] == [0.3, 0.4, 0.1, 1e-4]
    assert {"date", "machine", "python", "torch"} <= set(again)


def test_the_command_writes_table_figure_and_json(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bench" / "deep"
    assert main(["bench", "design", str(recipe_path), "--seconds", "1", "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:5] == ["recipe", "method", "status", "steps", "energies"]
    assert [line[:50].split("  ")[0] for line in lines[1:-1]] == ["tiny"] * len(METHODS)
    assert lines[-1] == f"wrote {out / 'design.png'} and {out / 'design.json'}"
    record = json.loads((out / "design.json").read_text())
    assert [run["method"] for run in record["runs"]] == [method.name for method in METHODS]
    for run in record["runs"]:
        # One line search may be under way when the time is over.
        assert run["seconds"] == sorted(run["seconds"])
        assert len(run["seconds"]) == len(run["errors"]) == len(run["energies"])
        assert run["evaluations"] >= len(run["seconds"])
    assert {run["status"] for run in record["runs"]} <= set(Status.__members__)
    with Image.open(out / "design.png") as image:
        assert image.size[0] == 1500


def test_the_command_prints_json_alone(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    monkeypatch.setattr("dicedesign.bench.design.METHODS", METHODS[:1])
    options = ["--seconds", "1", "--json", "--out", str(tmp_path)]
    assert main(["bench", "design", str(recipe_path), *options]) == 0
    captured = capsys.readouterr()
    assert len(json.loads(captured.out)["runs"]) == 1
    assert captured.err.startswith("wrote ")


def test_a_folder_that_cannot_be_written_is_noticed_before_the_work(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    def refuse(*arguments: object, **options: object) -> None:
        raise PermissionError(13, "Permission denied")

    def work(*arguments: object) -> None:
        raise AssertionError("began to work")

    monkeypatch.setattr("dicedesign.bench.design.run_method", work)
    monkeypatch.setattr("dicedesign.bench.reference.bodies_with_answers.make_subject", work)
    monkeypatch.setattr(Path, "touch", refuse)
    for arguments in (["design", str(recipe_path)], ["accuracy"]):
        assert main(["bench", *arguments, "--out", str(tmp_path)]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert "expected a folder that can be written, got 'Permission denied'" in captured.err


def test_results_are_printed_even_if_they_cannot_be_written(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr("dicedesign.bench.design.METHODS", METHODS[:1])
    monkeypatch.setattr("dicedesign.runtime.files.atomic_write", full)
    options = ["--seconds", "1", "--json", "--out", str(tmp_path)]
    assert main(["bench", "design", str(recipe_path), *options]) == 2
    captured = capsys.readouterr()
    assert len(json.loads(captured.out)["runs"]) == 1
    assert "the disk is full" in captured.err


def test_recipes_of_one_name_are_refused(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.yaml"
    other.write_text(RECIPE.replace("1e-2", "1e-3"))
    assert main(["bench", "design", str(recipe_path), str(other), "--out", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert (
        f"{other}: expected a recipe of another name than those before, got 'tiny' as in "
        f"{recipe_path}; change the name of one"
    ) in captured.err


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["missing.yaml"], "missing.yaml: expected a readable recipe file"),
        (["RECIPE", "--seconds", "0"], "--seconds: expected a positive number, got 0"),
        (["RECIPE", "--seconds", "nan"], "--seconds: expected a positive number, got nan"),
        (["RECIPE", "--out", "RECIPE"], "tiny.yaml: expected a folder that can be written"),
    ],
)
def test_bad_input_is_refused_in_words(
    arguments: list[str], text: str, recipe_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(recipe_path) if word == "RECIPE" else word for word in arguments]
    assert main(["bench", "design", *given]) == 2
    assert text in capsys.readouterr().err
