"""Every shipped recipe, designed and judged by the forward model."""

from __future__ import annotations

from pathlib import Path

import pytest

from dicedesign.design.stopping import Status
from dicedesign.design_stage import design_die, make_start
from dicedesign.recipe_file import read_recipe

RECIPES = sorted((Path(__file__).resolve().parents[1] / "recipes").glob("*.yaml"))
LARGEST_ERROR = {"fair_d3": 1e-6}
"""Where more is promised than `USUAL_ERROR`."""
USUAL_ERROR = 0.01
LARGEST_SECONDS = 60.0


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_a_recipe_gives_its_die_in_time(path: Path) -> None:
    recipe = read_recipe(path)
    die = design_die(recipe, make_start(recipe))
    verdict = die.verdict
    assert die.status is Status.CONVERGED
    assert verdict.max_abs_error <= LARGEST_ERROR.get(path.stem, USUAL_ERROR)
    assert verdict.max_abs_error <= recipe.method.tolerance
    assert sorted(verdict.outcome_of_rest) == list(range(len(die.target.labels)))
    assert die.design.history[-1].seconds <= LARGEST_SECONDS
