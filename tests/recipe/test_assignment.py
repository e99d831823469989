"""`assignment` in a recipe: each label gets its place with its own probability."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.optimize.starts.shapes import prism
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.reading import parse_recipe

PROBABILITIES = {"a": 0.22, "b": 0.24, "c": 0.26, "d": 0.28}
ORDER = "cabd"
"""Permutation that differs from its inverse."""

METHODS = {
    "paper": {"paper": {"prefer": {}}},
    "exact": {"exact": {"prefer": {}}},
    "thrown": {"exact": {"probabilities": "thrown", "prefer": {}}},
}


@pytest.mark.parametrize("method", METHODS)
def test_labels_get_their_places(method: str) -> None:
    """Facets move little from probabilities of 1/4 each."""
    if method == "thrown":
        pytest.importorskip("dicedesign_kernels")
    recipe = {
        "name": "die",
        "target": {"probabilities": list(PROBABILITIES.values()), "labels": list(PROBABILITIES)},
        "start": {"prism": {}},
        "assignment": list(ORDER),
        "method": METHODS[method],
    }
    work = design_recipe(parse_recipe(recipe), last="check")
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
