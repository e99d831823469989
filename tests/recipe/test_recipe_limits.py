"""The ends of what a recipe may say, and that it stays as it was read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from dicedesign.errors import RecipeError
from dicedesign.recipe.reading import parse_recipe, read_recipe
from dicedesign.recipe.recipe import Recipe

GOOD: dict[str, Any] = {"name": "die", "target": {"fair": 4}, "start": {"repulsion": {}}}


def labeled(label: str) -> dict[str, Any]:
    return {"target": {"probabilities": [0.25] * 4, "labels": ["a", "b", "c", label]}}


@pytest.mark.parametrize(
    "entries",
    [
        {"size_mm": 1000.0},
        {"size_mm": 30.0, "min_inradius_mm": 14.999},
        labeled("ä"),
    ],
)
def test_what_is_just_within_is_taken(entries: dict[str, Any]) -> None:
    assert isinstance(parse_recipe({**GOOD, **entries}), Recipe)


@pytest.mark.parametrize(
    ("entries", "key"),
    [
        ({"size_mm": 1000.1}, "size_mm"),
        ({"size_mm": 30.0, "min_inradius_mm": 15.0}, "min_inradius_mm"),
        (labeled("\ud800"), "labels"),
        ({"start": {"repulsion": {}, "repulsions": {}}}, "start"),
    ],
)
def test_what_is_just_beyond_is_refused_by_its_key(entries: dict[str, Any], key: str) -> None:
    with pytest.raises(RecipeError, match=key):
        parse_recipe({**GOOD, **entries})


def test_a_recipe_does_not_change() -> None:
    recipe = parse_recipe(GOOD)
    with pytest.raises(ValidationError, match="frozen"):
        recipe.seed = 3
    with pytest.raises(AttributeError):
        _ = recipe.start.no_such_kind


@pytest.mark.parametrize("method", ["", "method: exact\n"])
def test_a_change_makes_the_parts_that_it_needs(tmp_path: Path, method: str) -> None:
    path = tmp_path / "die.yaml"
    path.write_text("name: die\ntarget: {fair: 4}\n" + method)
    exact = read_recipe(path, ["method.exact.starts=7"]).method.exact
    assert exact is not None
    assert exact.starts == 7
