"""Every shipped recipe, designed, and judged by the forward model from the files it would write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from check_outputs import check
from common.paths import ROOT

from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.recipe.concave_run import run_concave_recipe
from dicedesign.recipe.design_stage import DesignedDie, design_die, make_start, thrown_die
from dicedesign.recipe.schema.reading import read_recipe
from dicedesign.recipe.table_summary import table_outcome
from dicedesign.rest.poses import rest_poses
from dicedesign.results.status import Status
from dicedesign.throws.statistics.total_variation import total_variation

RECIPES = sorted((ROOT / "recipes").glob("*.yaml"))
LARGEST_ERROR = {"fair_d3_descent": 1e-6, "2d6_descent": 1e-3, "binomial_4_descent": 1e-3}
"""Of the recipes by descent."""
EXACT = 1e-12
SINGLE, DOUBLE = 1e-5, 1e-11
"""What rounding to the float32 of an STL file, and reading a float64 OBJ file, may add."""
LARGEST_SECONDS = 60.0


CONCAVE = [path for path in RECIPES if "concave" in path.read_text()]
THROWN = [path for path in RECIPES if "thrown" in path.read_text()]
CONVEX = [path for path in RECIPES if path not in [*CONCAVE, *THROWN]]
LARGEST_DISPLACEMENT = 0.05
"""Mean, over the diagonal, of the recipes of concave dice."""


@pytest.mark.parametrize("path", CONVEX, ids=lambda path: path.stem)
def test_a_recipe_gives_its_die_in_time(path: Path, tmp_path: Path) -> None:
    recipe = read_recipe(path)
    die = design_die(recipe, make_start(recipe))
    verdict = die.verdict
    assert die.status is Status.CONVERGED
    allowed = LARGEST_ERROR.get(path.stem, EXACT)
    assert verdict.max_abs_error <= allowed
    assert verdict.max_abs_error <= recipe.method.tolerance
    assert sorted(verdict.outcome_of_rest) == list(range(len(die.target.labels)))
    assert die.design.history[-1].seconds <= LARGEST_SECONDS
    stl, obj = tmp_path / "die.stl", tmp_path / "die.obj"
    stl.write_bytes(stl_bytes(verdict.hull.vertices, verdict.hull.triangles))
    obj.write_text(obj_text(verdict.hull.vertices, verdict.hull.triangles))
    assert error_of_file(stl, die) <= allowed + SINGLE
    assert error_of_file(obj, die) <= allowed + DOUBLE


FEW = {"drops": 2000, "rounds": 3, "verdict": 5000, "within": 0.04}
"""Throws of a test; the recipes' own take minutes."""


@pytest.mark.parametrize("path", THROWN, ids=lambda path: path.stem)
def test_a_recipe_gives_its_die_for_the_table(path: Path) -> None:
    changes = [f"method.exact.refine.{key}={value}" for key, value in FEW.items()]
    recipe = read_recipe(path, changes)
    start = make_start(recipe)
    die = design_die(recipe, start)
    assert die.status is Status.CONVERGED
    assert sorted(die.verdict.outcome_of_rest) == list(range(len(die.target.labels)))
    on_table = thrown_die(recipe, die, start, None)
    status, _ = table_outcome(die.status, "", on_table, die.target, recipe)
    assert status is Status.CONVERGED
    assert total_variation(on_table.momentum, die.target.probabilities) < 0.1


@pytest.mark.parametrize("path", CONCAVE, ids=lambda path: path.stem)
def test_a_recipe_gives_its_concave_die_in_time(path: Path, tmp_path: Path) -> None:
    recipe = read_recipe(path)
    result = run_concave_recipe(recipe, tmp_path)
    assert result.status == "converged", result.message
    assert result.summary["search_seconds"] <= LARGEST_SECONDS
    summary = check(tmp_path)
    assert summary["max_abs_error"] <= recipe.method.tolerance
    assert summary["elsewhere"] <= recipe.method.tolerance
    assert summary["displacement"]["mean"] <= LARGEST_DISPLACEMENT


def obj_text(vertices: np.ndarray, triangles: np.ndarray) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    return "\n".join(lines) + "\n"


def error_of_file(path: Path, die: DesignedDie) -> float:
    """Largest |p - q| of the solid in a file; infinite unless it has one rest for each outcome."""
    poses = rest_poses(read_body(path))
    verdict, target = die.verdict, die.target.probabilities
    directions = verdict.hull.normals[verdict.facet_of_outcome]
    outcome = np.argmax(poses.normals @ directions.T, axis=1)
    if not np.array_equal(np.sort(outcome), np.arange(len(target))):
        return np.inf
    return float(np.abs(poses.probabilities - target[outcome]).max())
