"""What a search varies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dicedesign.optimize.preferences.preference import PREFERENCES, Preferences
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.search.space import search_space, varied_recipe


def made(**entries: Any) -> Recipe:
    return checked_recipe({"name": "die", "target": {"binomial": 3}, "seed": 7, **entries})


ASSIGNED = [f"assignment.{label}" for label in "0123"]


@pytest.mark.parametrize(
    ("entries", "assigned"),
    [
        ({"start": {"prism": {}}, "method": {"paper": {}}}, ASSIGNED),
        (
            {
                "start": {"repulsion": {}},
                "assignment": ["2", "0", "3", "1"],
                "method": {"exact": {}},
            },
            ASSIGNED,
        ),
        ({"start": {"prism": {}}, "target": {"fair": 4}, "method": {"paper": {}}}, []),
        ({"start": {"prism": {}}, "symmetry": "C2v", "method": {"exact": {}}}, []),
        ({"start": {"search": {}}, "method": {"exact": {}}}, []),
    ],
)
def test_labels_move_where_that_makes_a_difference(
    entries: dict[str, Any], assigned: list[str]
) -> None:
    recipe = made(**entries)
    space = search_space(recipe)
    # Odds without momentum have nothing to be robust against.
    names = [f"prefer.{name}" for name in PREFERENCES.names if name != "robustness"]
    assert set(space) == {*assigned, *(names if "exact" in entries["method"] else [])}
    own = {name: entry.own for name, entry in space.items()}
    assert all(entry.low <= entry.own <= entry.high for entry in space.values())
    expected = recipe.resolved()
    if assigned:
        expected["assignment"] = expected["assignment"] if "assignment" in entries else list("0123")
    assert varied_recipe(recipe, 0, own).resolved() == expected


def test_robustness_is_varied_where_dice_are_thrown() -> None:
    recipe = made(start={"search": {}}, method={"exact": {"odds": "thrown"}})
    assert "prefer.robustness" in search_space(recipe)


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
    assert own.prefer == Preferences(circles=25.0, margin=0.5, areas=1e-9)

    values |= {"prefer.roundness": 0.01, "prefer.areas": 0.0099, "prefer.margin": 1e-5}
    changed = varied_recipe(recipe, 3, values).method.exact
    assert changed is not None
    assert changed.prefer == Preferences(circles=25.0, roundness=0.01)


@pytest.mark.parametrize("weight", [0.0, 1e-9, 1e-5, 0.005, 0.01, 25.0])
def test_a_small_weight_of_the_recipe_is_kept(weight: float) -> None:
    recipe = made(start={"search": {}}, method={"exact": {"prefer": {"margin": weight}}})
    own = {name: entry.own for name, entry in search_space(recipe).items()}
    assert varied_recipe(recipe, 0, own).resolved() == recipe.resolved()


def test_labels_stay_where_a_symmetry_allows_few_assignments() -> None:
    """Of the totals of two dice, only equally probable ones may be images of each other."""
    recipe = made(
        target={"sum_of_dice": [6, 6]},
        start={"hendecahedron": "bisymmetric"},
        symmetry="C2",
        assignment=["2", "3", "4", "5", "6", "7", "8", "10", "9", "11", "12"],
        method={"exact": {}},
    )
    rng = np.random.default_rng(0)
    for number in range(20):
        values = {name: rng.uniform(e.low, e.high) for name, e in search_space(recipe).items()}
        varied = varied_recipe(recipe, number, values)
        assert varied.assignment == recipe.assignment
        design_recipe(varied, last="start")


def test_every_trial_has_its_seed_and_labels_in_the_order_of_their_numbers() -> None:
    recipe, rng = made(start={"prism": {}}, method={"paper": {}}), np.random.default_rng(0)
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
