"""The bench of the paper's method: what a die ends with, its tables and its verdict."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from common.benches import run_bench
from common.paths import ROOT
from PIL import Image

from dicedesign.bench.benches.paper import AblationRow, Extent, SeedsRow, SideRow
from dicedesign.bench.measures.designs.paper_designs import Ending, PaperProblem
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.recipe.schema.reading import checked_recipe, read_recipe
from dicedesign.results.status import Status

CUBE = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T
RECIPES = ROOT / "recipes" / "paper"


def ending(points: np.ndarray, directions: np.ndarray, target: np.ndarray) -> Ending:
    """Of a shape that nobody designed."""
    step = DesignStep(0, 0.0, 0.0, {}, 0.0)
    hull = convex_hull(points)
    result = DesignResult(Status.CONVERGED, hull, directions, 0.0, {}, (step,), 1, 1, 0)
    return Ending.of(result, target, None)


def test_a_cube_with_six_outcomes_and_one_more() -> None:
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    end = ending(CUBE, sides, np.full(6, 1 / 6))
    assert end.error == pytest.approx(0.0, abs=1e-12)
    assert (end.rests, end.empty) == (6, 0)
    assert end.least_angle == pytest.approx(90.0)
    assert end.stray == pytest.approx(0.0, abs=1e-5)
    lost = ending(CUBE, np.concatenate([sides, [[0.6, 0.8, 0.0]]]), np.full(7, 1 / 7))
    assert (lost.empty, lost.least_facet) == (1, 0.0)
    # All rests for one outcome: its main rest is a quarter turn or half a turn from the others.
    one = ending(CUBE, sides[:1], np.ones(1))
    assert one.stray == pytest.approx(180.0, abs=1e-5)
    assert one.least_angle == 180.0


def test_the_command_prints_all_tables_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Medians of three, as one start in a hundred ends with a stray rest whatever the terms are, and
    # of the same seeds in every run.
    monkeypatch.setattr("secrets.randbelow", lambda _: 12345)
    figure = tmp_path / "paper.png"
    extent = Extent(seeds=2, fresh=1, compared=True)
    recipe = RECIPES / "binomial_4.yaml"
    assert run_bench("paper", recipe, "--figure", figure, "--json", extent=extent) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["seeds_used"] == [0, 1, 12345]
    plain, exact = told["seeds"]
    assert plain["good"] == exact["good"] == plain["seeds"] == 3
    assert exact["worst_error"] <= 1e-12 < plain["median_error"] < 0.02
    assert [row["method"] for row in told["side_by_side"]] == ["paper", "finished", "exact"]
    assert all(0.0 < row["circle"] < 0.5 for row in told["side_by_side"])
    assert all(0.0 < row["thrown"] < 0.5 for row in told["side_by_side"])
    assert [row["left_out"] for row in told["ablation"]][:2] == ["all", "no coplanar"]
    # What the coplanar, neighbor and apart terms are for.
    by_name = {row["left_out"]: row for row in told["ablation"]}
    assert by_name["no apart"]["least_angle"] < 0.8 * by_name["all"]["least_angle"]
    assert by_name["dice alone"]["stray"] > by_name["all"]["stray"]
    with Image.open(figure) as image:
        assert min(image.size) > 300


def test_a_bad_die_is_the_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A tetrahedron does not get such odds."""
    recipe = tmp_path / "die.yaml"
    recipe.write_text(
        "name: hard\ntarget: {probabilities: [0.97, 0.01, 0.01, 0.01]}\n"
        "start: {repulsion: {}}\nmethod: {paper: {steps: 5}}\n"
    )
    extent = Extent(seeds=1, fresh=0, compared=False)
    assert run_bench("paper", recipe, extent=extent) == 1
    assert "hard" in capsys.readouterr().out


def test_rows_know_what_they_are_of() -> None:
    problem = PaperProblem.of(read_recipe(RECIPES / "binomial_2.yaml"))
    runs = [problem.seeded(0)]
    plain, exact = (SeedsRow.of("paper_binomial_2", runs, exact=one) for one in (False, True))
    assert plain.published == 0.0069
    assert exact.published is None
    assert plain.moved is None
    assert exact.moved == runs[0].moved > 0.0
    assert {row.table for row in (SeedsRow, SideRow, AblationRow)} == {
        "seeds",
        "side_by_side",
        "ablation",
    }


def test_a_recipe_of_another_method_is_refused() -> None:
    recipe = checked_recipe({"name": "other", "target": {"fair": 4}})
    with pytest.raises(InputError, match="expected a recipe of method paper, got exact"):
        PaperProblem.of(recipe)
