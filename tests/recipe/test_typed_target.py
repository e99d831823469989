"""What is typed is what a recipe says."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import RecipeError
from dicedesign.recipe.reading import format_probabilities, parse_target
from dicedesign.recipe.target import TargetRecipe


@pytest.mark.parametrize(
    ("text", "entries"),
    [
        ("fair: 7", {"fair": 7}),
        (" fair:7", {"fair": 7}),
        ("sum_of_dice: [6, 6]", {"sum_of_dice": [6, 6]}),
        ("{binomial: 4}", {"binomial": 4}),
        ("probabilities: [1/2, 0.5]", {"probabilities": ["1/2", 0.5]}),
        ("1/2,1/3, 1/6", {"probabilities": ["1/2", "1/3", "1/6"]}),
    ],
)
def test_targets(text: str, entries: dict[str, object]) -> None:
    assert parse_target(text) == entries
    assert parse_target(text, "a, b") == {**entries, "labels": ["a", "b"]}


@pytest.mark.parametrize("text", ["a:", ": :", "[a: 1]", "fair: [", "!!python/x: y", "- a: 1"])
def test_what_is_neither(text: str) -> None:
    with pytest.raises((RecipeError, ValueError)):
        TargetRecipe.model_validate(parse_target(text))


def test_probabilities_are_written_to_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    for probabilities in (
        np.arange(1, 7) / 21.0,
        rng.dirichlet(np.ones(5)),
        np.array([1e-9, 1.0 - 1e-9]),
    ):
        text = format_probabilities(probabilities.tolist())
        read = TargetRecipe.model_validate(parse_target(text))
        assert read.probabilities == probabilities.tolist()
    assert format_probabilities([1 / 2, 1 / 3, 1 / 6]) == "1/2, 1/3, 1/6"
