"""What a search varies."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from dicedesign.design.preferences import Preferences
from dicedesign.recipe import Recipe
from dicedesign.recipe_file import checked_recipe
from dicedesign.search.space import search_space, varied_recipe


def made(**entries: Any) -> Recipe:
    return checked_recipe({"name": "die", "target": {"binomial": 3}, "seed": 7, **entries})


ASSIGNED = [f"assignment.{label}" for label in "0123"]


@pytest.mark.parametrize(
    ("entries", "assigned"),
    [
        ({"start": {"prism": {}}, "method": {"descent": {}}}, ASSIGNED),
        (
            {
                "start": {"repulsion": {}},
                "assignment": ["2", "0", "3", "1"],
                "method": {"exact": {}},
            },
            ASSIGNED,
        ),
        ({"start": {"prism": {}}, "target": {"fair": 4}, "method": {"descent": {}}}, []),
        ({"start": {"search": {}}, "method": {"exact": {}}}, []),
    ],
)
def test_labels_move_where_that_makes_a_difference(
    entries: dict[str, Any], assigned: list[str]
) -> None:
    recipe = made(**entries)
    space = search_space(recipe)
    names = [f"prefer.{item.name}" for item in fields(Preferences)]
    assert set(space) == {*assigned, *(names if "exact" in entries["method"] else [])}
    own = {name: entry.own for name, entry in space.items()}
    assert all(entry.low <= entry.own <= entry.high for entry in space.values())
    expected = recipe.resolved()
    if assigned:
        expected["assignment"] = expected["assignment"] if "assignment" in entries else list("0123")
    assert varied_recipe(recipe, 0, own).resolved() == expected


def test_weights_of_preferences_are_on_or_off() -> None:
    prefer = {"circles": 25.0, "margin": 0.5, "areas": 1e-9}
    recipe = made(start={"search": {}}, method={"exact": {"prefer": prefer}})
    space = search_space(recipe)
    assert {entry.low for entry in space.values()} == {1e-5}
    assert {entry.high for name, entry in space.items() if name != "prefer.circles"} == {10.0}
    assert all(entry.logarithmic for entry in space.values())
    assert space["prefer.circles"].high == 25.0

    values = {name: entry.own for name, entry in space.items()}
    own = varied_recipe(recipe, 0, values).method.exact
    assert own is not None
    # A weight as small as the last one is as good as none.
    assert own.prefer == Preferences(circles=25.0, margin=0.5)

    values |= {"prefer.roundness": 0.01, "prefer.areas": 0.0099, "prefer.margin": 1e-5}
    changed = varied_recipe(recipe, 3, values).method.exact
    assert changed is not None
    assert changed.prefer == Preferences(circles=25.0, roundness=0.01)


def test_every_trial_has_its_seed_and_labels_in_the_order_of_their_numbers() -> None:
    recipe, rng = made(start={"prism": {}}, method={"descent": {}}), np.random.default_rng(0)
    seen = set()
    for number in range(200):
        values = {name: rng.random() for name in ASSIGNED}
        varied = varied_recipe(recipe, number, values)
        assert varied.seed == 7 + number
        assert varied.assignment is not None
        numbers = [values[f"assignment.{label}"] for label in varied.assignment]
        assert numbers == sorted(values.values())
        seen.add(tuple(varied.assignment))
        assert varied.target == recipe.target
        assert varied.start == recipe.start
    assert len(seen) == 24
