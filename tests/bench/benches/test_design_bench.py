"""The bench that compares methods of design, and what it writes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from common.benches import run_bench
from PIL import Image

from dicedesign import rest_poses
from dicedesign.bench.benches.design import METHODS, Extent, MethodRow, SeedRun, run_method
from dicedesign.bench.frame import BENCHES, Run
from dicedesign.bench.measures.recipes import begun
from dicedesign.cli.main import main
from dicedesign.recipe.schema.reading import read_recipe
from dicedesign.recipe.schema.recipe import Recipe

RECIPE = """
name: tiny
target: {probabilities: [0.3, 0.3, 0.4]}
start: {prism: {}}
method: {paper: {steps: 60, weights: {coplanar: 0.3}}}
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
    own = recipe.method.paper
    assert own is not None
    seen = set()
    for method in METHODS:
        changed = method.set_up(recipe, 7)
        assert changed.seed == 7
        assert changed.model_copy(update={"method": recipe.method, "seed": recipe.seed}) == recipe
        seen.add(repr(changed.method))
        assert changed.method.name == ("exact" if method.name == "exact" else "paper")
        options = changed.method.paper
        if options is None:
            continue
        assert (options.weights, options.steps) == (own.weights, 60)
        assert options.step == ("line_search" if "line search" in method.name else "momentum")
        power = None if options.sobolev is None else options.sobolev.power
        assert power == (int(method.name[-1]) if "Sobolev" in method.name else None)
        assert options.finish == ("exact" if "finish" in method.name else "none")
    assert len(seen) == len(METHODS)


@pytest.mark.parametrize("method", METHODS[:3], ids=lambda method: method.name)
def test_a_run_records_every_step_and_the_finished_die(recipe: Recipe, method) -> None:
    start = begun(recipe).start
    assert start is not None
    steps = []
    run = run_method(recipe, method, 0, steps.append)
    assert run.converged
    assert run.errors[-1] <= (2e-2 if method.finish == "none" and method.step else 1e-12)
    assert len(steps) == len(run.errors) == len(run.energies) == len(run.seconds)
    assert run.evaluations >= len(steps)
    # The dice energy of three outcomes lies between one and three squares of the largest error.
    for error, energy in zip(run.errors, run.energies, strict=True):
        assert error**2 <= energy * (1 + 1e-9) + 1e-30
        assert energy <= 3.0 * error**2 + 1e-30
    # The first error is that of the start, but for its perturbation of a thousandth.
    assert np.ptp(rest_poses(start.points).probabilities) < 1e-9
    assert run.errors[0] == pytest.approx(0.4 - 1.0 / 3.0, abs=5e-3)


def seed_run(last: float, slower: float = 1.0) -> SeedRun:
    seconds = tuple(slower * second for second in (0.05, 0.2, 0.5, 2.0))
    return SeedRun(
        last < 1e-2, last, 9, last, seconds, (0.3, 0.4, 0.1, last), (0.1, 0.2, 0.01, 0.0)
    )


def test_a_row_has_medians_over_the_seeds(recipe: Recipe) -> None:
    runs = [seed_run(1e-4), seed_run(3e-4, 2.0), seed_run(0.05, 3.0)]
    row = MethodRow.of(recipe, METHODS[2], runs)
    assert (row.seeds, row.converged, row.near) == (3, 2, 2)
    assert (row.median_error, row.worst_error) == (3e-4, 0.05)
    assert (row.median_seconds, row.worst_seconds) == (4.0, 6.0)
    assert row.errors[0] == 0.3
    assert row.errors[-1] == 3e-4
    assert list(row.errors) == sorted(row.errors, reverse=True)
    # Between 1 and 1.5 seconds the first two are at 0.1, and the third is at 0.3 up to 1.5.
    place = int(np.searchsorted(row.seconds, 1.2))
    assert row.errors[place] == 0.1


def test_the_figure_has_a_row_for_each_recipe(recipe: Recipe) -> None:
    other = recipe.model_copy(update={"name": "other"})
    rows = [
        MethodRow.of(recipe, METHODS[0], [seed_run(1e-4)]),
        MethodRow.of(recipe, METHODS[1], [seed_run(0.05)]),
        MethodRow.of(other, METHODS[0], [seed_run(1e-4)]),
    ]
    figure = BENCHES["design"].figure
    assert figure is not None
    paper = figure(rows, Run(None))
    names = {METHODS[0].name, METHODS[1].name}
    assert {"tiny: error, max |p − q|", "other: dice energy", *names} <= set(paper.texts)
    assert paper.width == 1500


def test_the_command_writes_table_figure_and_json(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bench" / "deep"
    extent = Extent(2, METHODS[:3])
    assert run_bench("design", recipe_path, "--out", out, extent=extent) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:4] == ["recipe", "method", "seeds", "done"]
    assert [line.split()[0] for line in lines[1:-1]] == ["tiny"] * 3
    record = json.loads((out / "design.json").read_text())
    for run in record["runs"]:
        assert run["seconds"] == sorted(run["seconds"])
        assert len(run["seconds"]) == len(run["errors"]) == len(run["energies"])
        assert run["converged"] == run["seeds"] == 2
    with Image.open(out / "design.png") as image:
        assert image.size[0] == 1500


def test_recipes_of_one_name_are_refused(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.yaml"
    other.write_text(RECIPE.replace("60", "70"))
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
