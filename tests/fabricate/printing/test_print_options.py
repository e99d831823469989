"""Options of printing that cannot be, and how a recipe is told."""

from __future__ import annotations

from typing import Any

import pytest

from dicedesign.errors import InputError
from dicedesign.fabricate.printing.options import PrintOptions
from dicedesign.fabricate.printing.print_errors import PrintErrors
from dicedesign.recipe.schema.reading import checked_recipe


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"infill": 1.5}, "infill: expected a number from 0 to 1, got 1.5; 0.2 is 20 %"),
        ({"infill": float("nan")}, "infill: expected a number from 0 to 1, got nan"),
        ({"walls_mm": 0.0}, "walls_mm: expected a number above 0, got 0"),
        ({"walls_mm": float("inf")}, "walls_mm: expected a number above 0, got inf"),
    ],
)
def test_how_to_print(given: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match=text):
        PrintOptions(**given)
    with pytest.raises(InputError, match="print.*" + text.split(";")[0]):
        checked_recipe({"name": "d", "target": {"fair": 6}, "print": given})


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"dimensional_mm": -0.1}, "errors.dimensional_mm: expected a number of at least 0, got"),
        ({"shrinkage": 0.2}, "errors.shrinkage: expected a number of at least 0 and below 0.2"),
        ({"density_gradient": 0.5}, "errors.density_gradient: .* below 0.5, got 0.5; leave it out"),
        ({"bubble_mm3": float("nan")}, "errors.bubble_mm3: expected a number of at least 0, got"),
        ({"bubble_mm3": True}, "errors.bubble_mm3: expected a number of at least 0, got True"),
        ({"bubble_mm3": float("inf")}, "errors.bubble_mm3: expected a number of at least 0"),
    ],
)
def test_what_differs_from_print_to_print(given: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        PrintErrors(**given)


def test_a_recipe_says_how_it_will_be_printed() -> None:
    given = {"infill": 0.2, "walls_mm": 0.8, "errors": {"dimensional_mm": 0.05}}
    recipe = checked_recipe({"name": "d", "target": {"fair": 6}, "print": given})
    assert recipe.print == PrintOptions(
        infill=0.2, walls_mm=0.8, errors=PrintErrors(dimensional_mm=0.05)
    )
    again = checked_recipe(recipe.resolved())
    assert again.print == recipe.print
