"""The numbers that a search varies, and the recipe that those of a trial make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.recipe.schema.recipe import Recipe

__all__ = ["Range", "search_space", "varied_recipe", "varies_assignment"]

WEIGHTS: Final = (1e-5, 10.0)
"""Least and largest weight of a preference that is proposed, evenly in its logarithm."""

OFF_BELOW: Final = 0.01
"""A proposed weight below this is 0 in the recipe, unless it is the recipe's own: half of the range
leaves a preference out."""


@dataclass(frozen=True)
class Range:
    """A number that a search varies.

    Attributes
    ----------
    low, high: the least and the largest that is proposed.
    logarithmic: proposed evenly in the logarithm.
    own: at which the recipe is as it was given.
    """

    low: float
    high: float
    logarithmic: bool
    own: float


def varies_assignment(recipe: Recipe) -> bool:
    """True if a search gives the labels other directions: where the start is given and not all
    outcomes are equally probable. Not with a symmetry, which allows few assignments: facets that
    are images of each other bear outcomes of one probability."""
    probabilities = recipe.target.target().probabilities
    given = recipe.start.kind.search is None and recipe.symmetry is None
    return given and bool(np.ptp(probabilities) > 0.0)


def search_space(recipe: Recipe) -> dict[str, Range]:
    """The numbers that a search of a recipe varies, by name.

    "assignment.LABEL": labels take the start's directions in the order of these numbers; where
    `varies_assignment`. "prefer.NAME": weights of preferences; where the method is exact. The seed
    is not among them: it is another for each trial.
    """
    space: dict[str, Range] = {}
    if varies_assignment(recipe):
        order = recipe.assignment or recipe.target.target().labels
        space |= {
            f"assignment.{label}": Range(0.0, 1.0, False, (place + 0.5) / len(order))
            for place, label in enumerate(order)
        }
    for name, weight in _own_weights(recipe).items():
        low, high = WEIGHTS
        own = max(weight, low)
        space[f"prefer.{name}"] = Range(low, max(high, own), True, own)
    return space


def varied_recipe(recipe: Recipe, place: int, values: Mapping[str, float]) -> Recipe:
    """The recipe of a trial: its place in the search is added to the seed, and the numbers of
    `search_space` take the given values. With `Range.own` for all, that at place 0 is the recipe as
    it was given."""
    entries, space = recipe.resolved(), search_space(recipe)
    entries["seed"] += place
    order = {
        name.removeprefix("assignment."): value
        for name, value in values.items()
        if name.startswith("assignment.")
    }
    if order:
        entries["assignment"] = sorted(order, key=order.__getitem__)
    for name in _own_weights(recipe):
        weight = values[f"prefer.{name}"]
        if weight != space[f"prefer.{name}"].own:
            entries["method"]["exact"]["prefer"][name] = weight if weight >= OFF_BELOW else 0.0
    return checked_recipe(entries)


def _own_weights(recipe: Recipe) -> dict[str, float]:
    exact = recipe.method.exact
    weights = {} if exact is None else exact.prefer.as_dict()
    if not recipe.method.thrown:
        # Odds without momentum are the same on every table.
        weights.pop("robustness", None)
    return weights
