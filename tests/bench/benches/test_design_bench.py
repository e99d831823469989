"""The bench that compares methods of design, and what it writes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from common.benches import run_bench
from PIL import Image

from dicedesign import rest_poses
from dicedesign.bench.benches.design import (
    METHODS,
    Extent,
    MethodRow,
    run_method,
    smallest_until,
)
from dicedesign.bench.frame import BENCHES, Run
from dicedesign.bench.measures.recipes import begun
from dicedesign.cli.main import main
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.recipe.schema.reading import read_recipe
from dicedesign.recipe.schema.recipe import Recipe

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
        changed = method.set_up(recipe, 7.0)
        options = changed.method.descent
        assert changed.model_copy(update={"method": recipe.method}) == recipe
        seen.add(repr(changed.method))
        if method.name == "exact":
            assert changed.method.exact == ExactOptions(prefer=Preferences(), seconds=7.0)
            continue
        assert options.stopping == replace(own.stopping, seconds=7.0)
        assert options.weights.coplanar == 0.3
        assert options.coordinates == ("facets" if method.name == "facets" else "vertices")
        power = None if options.sobolev is None else options.sobolev.power
        assert power == (int(method.name[-1]) if "Sobolev" in method.name else None)
        expected = 0.0 if method.name.startswith("paper") else own.weights.stability
        assert options.weights.stability == expected
    assert len(seen) == len(METHODS)


def test_a_run_records_every_step_and_the_finished_die(recipe: Recipe) -> None:
    start = begun(recipe).start
    assert start is not None
    steps = []
    run = run_method(recipe, METHODS[0], 20.0, steps.append)
    assert run.status == "converged"
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


def made(
    method: str, recipe: str = "r", status: str = "converged", last: float = 1e-4
) -> MethodRow:
    times, errors, energies = (0.05, 0.2, 0.5, 2.0), (0.3, 0.4, 0.1, last), (0.1, 0.2, 0.01, 0.0)
    numbers = (3, 5, 2, 3, 2.0, 0.3, 0.1, last, 0.0, 1e-4, 1e-3)
    return MethodRow(recipe, method, status, *numbers, times, errors, energies)


@pytest.mark.parametrize(
    ("seconds", "error"), [(0.01, 0.3), (0.2, 0.3), (0.49, 0.3), (0.5, 0.1), (9.0, 1e-4)]
)
def test_the_error_after_some_time_is_the_smallest_so_far(seconds: float, error: float) -> None:
    row = made("m")
    assert smallest_until(row.seconds, row.errors, seconds) == error


def test_the_figure_has_a_row_for_each_recipe() -> None:
    rows = [made("m"), made("n", status="no_progress", last=0.2), made("m", recipe="other")]
    figure = BENCHES["design"].figure
    assert figure is not None
    paper = figure(rows, Run(None))
    assert {"r: error, max |p − q|", "other: dice energy", "m", "n"} <= set(paper.texts)
    assert paper.width == 1500


def test_the_command_writes_table_figure_and_json(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bench" / "deep"
    extent = Extent(1.0, METHODS[:2])
    assert run_bench("design", recipe_path, "--out", out, extent=extent) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:5] == ["recipe", "method", "status", "steps", "energies"]
    assert [line.split()[:2] for line in lines[1:-1]] == [["tiny", "exact"], ["tiny", "facets"]]
    record = json.loads((out / "design.json").read_text())
    for run in record["runs"]:
        # One line search may be under way when the time is over.
        assert run["seconds"] == sorted(run["seconds"])
        assert len(run["seconds"]) == len(run["errors"]) == len(run["energies"])
        assert run["evaluations"] >= len(run["seconds"])
        assert run["status"] == "converged"
    with Image.open(out / "design.png") as image:
        assert image.size[0] == 1500


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


def test_a_recipe_whose_start_is_searched_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "searched.yaml"
    path.write_text("{name: searched, target: {fair: 6}, start: {search: {}}}")
    assert main(["bench", "design", str(path), "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "searched: expected a start that all methods can share, got start.search" in error
