"""`assignment` in a recipe: each label gets its place with its own probability."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.optimize.starts.shapes import prism
from dicedesign.recipe.convex import make_design, wanted_of_directions
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.parts import RoundOfThrows, Status

PROBABILITIES = {"a": 0.22, "b": 0.24, "c": 0.26, "d": 0.28}
ORDER = "cabd"
"""Permutation that differs from its inverse."""

METHODS = {
    "paper": {"paper": {"prefer": {}}},
    "exact": {"exact": {"prefer": {}}},
    "thrown": {"exact": {"probabilities": "thrown", "prefer": {}}},
}


def recipe(method: str) -> Recipe:
    return parse_recipe(
        {
            "name": "die",
            "target": {
                "probabilities": list(PROBABILITIES.values()),
                "labels": list(PROBABILITIES),
            },
            "start": {"prism": {}},
            "assignment": list(ORDER),
            "method": METHODS[method],
        }
    )


@pytest.mark.parametrize("method", METHODS)
def test_labels_get_their_places(method: str) -> None:
    """Facets move little from probabilities of 1/4 each."""
    if method == "thrown":
        pytest.importorskip("dicedesign_kernels")
    work = design_recipe(recipe(method), last="check")
    directions = dict(zip(work.target.labels, work.die.directions, strict=True))
    for label, named in zip(ORDER, prism(4).directions, strict=True):
        assert directions[label] @ named > np.cos(np.radians(20.0))
    if method == "thrown":
        return
    outcomes = work.solid.outcomes
    np.testing.assert_allclose(
        outcomes.probabilities, [PROBABILITIES[x] for x in work.target.labels], atol=1e-5
    )
    own = work.solid.poses.normals[outcomes.main]
    assert (
        np.argmax(own @ prism(4).directions.T, axis=1) == [ORDER.index(x) for x in "abcd"]
    ).all()


def test_results_by_direction_are_reordered_by_outcome() -> None:
    given, start = recipe("thrown"), prism(4)
    np.testing.assert_array_equal(
        wanted_of_directions(given)[0], [PROBABILITIES[label] for label in ORDER]
    )
    requested, frequencies = (0.1, 0.2, 0.3, 0.4), (0.15, 0.25, 0.35, 0.2)
    result = DesignResult(
        Status.CONVERGED, convex_hull(start.points), start.directions, 0.0, {}, (), 1, 1, 0
    )
    rounds = (RoundOfThrows(100, 0.1, 0.01, 0.1, True, requested, frequencies),)
    die = make_design(Work(given), result, rounds)
    for place, label in enumerate(ORDER):
        outcome = "abcd".index(label)
        np.testing.assert_array_equal(die.directions[outcome], start.directions[place])
        assert die.rounds[0].requested[outcome] == requested[place]
        assert die.rounds[0].frequencies[outcome] == frequencies[place]
