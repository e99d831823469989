"""Every shipped recipe, judged by the forward model from files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from check_outputs import check
from common.paths import ROOT

from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import read_recipe
from dicedesign.results.parts import Status
from dicedesign.throws.distances import total_variation

pytestmark = pytest.mark.shipped

RECIPES = sorted((ROOT / "recipes").rglob("*.yaml"))
EXACT = 1e-12
SINGLE = 1e-5
"""Error by rounding to float32 in STL files."""
MOST_EVALUATIONS, MOST_ATTEMPTS = 20_000, 20
"""Maximum number of dice that are tried, for convex and concave ones."""


def _name(path: Path) -> str:
    return str(path.relative_to(ROOT / "recipes").with_suffix(""))


OTHERS = [path for path in RECIPES if re.search("concave|thrown", path.read_text())]
CONVEX = [path for path in RECIPES if path not in OTHERS]
# The recipes of finished dice repeat others, and take long.
CONCAVE = [path for path in OTHERS if "concave" in path.read_text() and "finished" not in path.stem]
THROWN = [path for path in OTHERS if "thrown" in path.read_text() and "finished" not in path.stem]
LARGEST_DISPLACEMENT = 0.05
"""Mean, over the diagonal, of the recipes of concave dice."""
ENOUGH = 8
"""Attempts in tests; the recipes have more."""


@pytest.mark.parametrize("recipe_path", CONVEX, ids=_name)
def test_a_recipe_gives_its_die_with_little_work(recipe_path: Path) -> None:
    recipe = read_recipe(recipe_path)
    work = design_recipe(recipe, last="check")
    solid, target = work.solid, work.target.probabilities
    assert work.status is Status.CONVERGED
    assert solid.outcomes.max_abs_error(target) <= min(EXACT, recipe.method.tolerance)
    assert sorted(solid.outcomes.outcome_of_rest) == sorted(work.target.outcome_of_face)
    assert work.plain.max_abs_error <= SINGLE
    assert work.plain.outcomes.elsewhere == 0.0
    assert work.die.evaluations <= MOST_EVALUATIONS


FEW = {"drops": 8000, "rounds": 8, "verdict": 10_000, "within": 0.03}
"""Throws in tests; the recipes have more."""


@pytest.mark.parametrize("path", THROWN, ids=_name)
def test_a_recipe_gives_its_die_for_the_table(path: Path) -> None:
    changes = [f"method.exact.refine.{key}={value}" for key, value in FEW.items()]
    recipe = read_recipe(path, changes)
    work = design_recipe(recipe)
    target = work.target.probabilities
    assert work.status is Status.CONVERGED
    assert sorted(work.plain.outcomes.outcome_of_rest) == sorted(work.target.outcome_of_face)
    assert total_variation(work.thrown.momentum, target) < 0.1
    measured = work.thrown.measure(target)
    assert measured.drops == FEW["verdict"]
    expected = next((one.expected for one in work.die.rounds if one.is_kept), 0.0)
    assert measured.total_variation <= 2.0 * float(np.hypot(expected, measured.noise_floor))


@pytest.mark.parametrize("path", CONCAVE, ids=_name)
def test_a_recipe_gives_its_concave_die_in_few_attempts(path: Path, tmp_path: Path) -> None:
    recipe = read_recipe(path, [f"method.concave.enough={ENOUGH}"])
    result = run(recipe, tmp_path)
    assert result.status == "converged", result.message
    assert result.search.attempts <= MOST_ATTEMPTS
    summary = check(tmp_path)
    assert max(summary["max_abs_error"], summary["elsewhere"]) <= recipe.method.tolerance
    assert summary["concave"]["displacement"]["mean"] <= LARGEST_DISPLACEMENT
