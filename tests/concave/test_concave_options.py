"""Messages about invalid options of concave dice."""

from __future__ import annotations

import math
from typing import Any

import pytest

from dicedesign.concave.options import ConcaveOptions, ConcavePaperOptions, HollowOptions
from dicedesign.errors import InputError, RecipeError
from dicedesign.recipe.reading import parse_recipe


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"tolerance": 1.0}, "tolerance: expected a number above 0 and below 1, got 1; leave it"),
        ({"hull": "exact"}, "hull: expected gauss_newton or paper, got 'exact'; choose one"),
        (
            {"paper": ConcavePaperOptions()},
            "paper: expected hull: paper or fill: paper with it, got gauss_newton and corr",
        ),
        (
            {"hollow": HollowOptions(), "fill": "paper"},
            "hollow: expected hull: gauss_newton and fill: correspondence with it, got gauss_n",
        ),
        ({"points": 49}, "points: expected at least 50, got 49; raise it, or leave it out to keep"),
        ({"attempts": 0}, "attempts: expected a whole number above 0, got 0; leave it out for 60"),
        ({"apart_deg": 180.0}, "apart_deg: expected degrees from 0 to below 180, got 180; leave"),
        ({"margin_deg": 90.0}, "margin_deg: expected degrees from 0 to below 90, got 90; leave it"),
        ({"displacement": 0.0}, "displacement: expected a positive number, got 0; leave it out"),
        ({"seconds": -1.0}, "seconds: expected a positive number, got -1; leave it out"),
    ],
)
def test_values_out_of_range(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        ConcaveOptions(**options)


@pytest.mark.parametrize("wall", [0.0, math.nan])
def test_invalid_walls_are_refused(wall: float) -> None:
    with pytest.raises(InputError, match="wall_mm: expected a positive number, got"):
        HollowOptions(wall_mm=wall)


def test_the_limits_of_the_ranges_are_valid() -> None:
    options = ConcaveOptions(tolerance=0.999, points=50, attempts=1, displacement=1e-9, seconds=0.1)
    ConcaveOptions(apart_deg=0.0, margin_deg=0.0)
    ConcaveOptions(apart_deg=179.9, margin_deg=89.9)
    assert (options.hull, options.fill) == ("gauss_newton", "correspondence")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"step": "newton"}, "paper.step: expected momentum or line_search, got 'newton'; choose"),
        ({"steps": 0}, "paper.steps: expected a whole number above 0, got 0; leave it out for 600"),
        ({"closest_point": 0.0}, "paper.closest_point: expected a positive number, got 0; leave"),
        ({"center_of_mass": math.inf}, "paper.center_of_mass: expected a positive number, got inf"),
        ({"growth": 1.0}, "paper.growth: expected a number above 1 and at most 100, got 1; leave"),
        (
            {"gamma": 0.0},
            r"paper.gamma: expected a number above 0 and at most 1e\+06, got 0; leave",
        ),
        ({"power": 5}, "paper.power: expected 1 to 4, got 5; leave it out for 2"),
    ],
)
def test_values_of_the_paper_s_options_out_of_range(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        ConcavePaperOptions(**options)


def test_a_recipe_sets_the_paper_s_options() -> None:
    method = {
        "concave": {
            "hull": "paper",
            "fill": "paper",
            "paper": {"weights": {"barycenter": 0.3}, "bending": 0.5, "power": 3},
        }
    }
    entries = {"name": "die", "target": {"fair": 3}, "start": {"shape": "duck"}}
    options = parse_recipe({**entries, "method": method}).method.concave
    assert options.paper.weights.barycenter == 0.3
    assert options.paper.weights.apart == ConcavePaperOptions().weights.apart
    assert (options.paper.bending, options.paper.power) == (0.5, 3)
    method["concave"]["paper"] = {"weights": {"coplaner": 1.0}}
    with pytest.raises(RecipeError, match="coplaner"):
        parse_recipe({**entries, "method": method})
