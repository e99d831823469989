"""Messages about invalid options of concave dice."""

from __future__ import annotations

import math
from typing import Any

import pytest

from dicedesign.concave.options import ConcaveOptions, ConcavePaperOptions, HollowOptions
from dicedesign.errors import InputError, RecipeError
from dicedesign.recipe.reading import parse_recipe

BAD: list[tuple[type, dict[str, Any], str]] = [
    (ConcaveOptions, {"tolerance": 1.0}, "tolerance: expected a number above 0 and below 1, got 1"),
    (ConcaveOptions, {"hull": "exact"}, "hull: expected gauss_newton or paper, got 'exact'; cho"),
    (
        ConcaveOptions,
        {"paper": ConcavePaperOptions()},
        "paper: expected hull: paper or fill: paper with it, got gauss_newton and corr",
    ),
    (
        ConcaveOptions,
        {"hollow": HollowOptions(), "fill": "paper"},
        "hollow: expected hull: gauss_newton and fill: correspondence with it, got gauss_n",
    ),
    (ConcaveOptions, {"points": 49}, "points: expected at least 50, got 49; raise it"),
    (ConcaveOptions, {"attempts": 0}, "attempts: expected a whole number above 0, got 0"),
    (ConcaveOptions, {"margin_deg": 90.0}, "margin_deg: expected degrees from 0 to below 90"),
    (HollowOptions, {"wall_mm": math.nan}, "wall_mm: expected a positive number, got"),
    (ConcavePaperOptions, {"steps": 0}, "paper.steps: expected a whole number above 0, got 0"),
    (ConcavePaperOptions, {"growth": 1.0}, "paper.growth: expected a number above 1 and at most"),
    (ConcavePaperOptions, {"power": 5}, "paper.power: expected 1 to 4, got 5"),
]


@pytest.mark.parametrize(("kind", "options", "text"), BAD)
def test_values_out_of_range(kind: type, options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        kind(**options)


def test_the_limits_of_the_ranges_are_valid() -> None:
    options = ConcaveOptions(tolerance=0.999, points=50, attempts=1, displacement=1e-9, seconds=0.1)
    ConcaveOptions(apart_deg=0.0, margin_deg=0.0)
    ConcaveOptions(apart_deg=179.9, margin_deg=89.9)
    assert (options.hull, options.fill) == ("gauss_newton", "correspondence")


def test_a_recipe_sets_the_paper_s_options() -> None:
    method = {
        "concave": {
            "hull": "paper",
            "fill": "paper",
            "paper": {"weights": {"barycenter": 0.3}, "bending": 0.5, "power": 3},
        }
    }
    entries = {"name": "die", "target": {"fair": 3}, "start": {"shape": "duck"}, "method": method}
    options = parse_recipe(entries).method.concave
    assert options.paper.weights.barycenter == 0.3
    assert options.paper.weights.apart == ConcavePaperOptions().weights.apart
    assert (options.paper.bending, options.paper.power) == (0.5, 3)
    method["concave"]["paper"] = {"weights": {"coplaner": 1.0}}
    with pytest.raises(RecipeError, match="coplaner"):
        parse_recipe(entries)
