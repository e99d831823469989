"""Who listens to a run is told of shapes as well as of steps, and can end it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Callbacks
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses

METHODS: list[dict[str, Any]] = [
    {"start": {"search": {}}},
    {"start": {"prism": {}}, "assignment": ["c", "a", "b"]},
    {"start": {"prism": {}}, "method": {"paper": {"steps": 40}}, "assignment": ["c", "a", "b"]},
]


@pytest.mark.parametrize("entries", METHODS, ids=["searched", "exact", "paper"])
def test_shapes_have_the_probabilities_of_their_steps(entries: dict[str, Any]) -> None:
    target = {"probabilities": [0.5, 0.3, 0.2], "labels": ["a", "b", "c"]}
    recipe = parse_recipe({"name": "d3", "target": target, **entries})
    told, errors, starts = [], [], []
    callbacks = Callbacks(
        on_start=starts.append,
        on_shape=lambda hull, directions: told.append((hull, directions)),
        on_step=lambda step: errors.append(step.max_abs_error),
    )
    work = design_recipe(recipe, callbacks, last="design")
    assert len(told) == len(errors) == len(work.die.steps)
    assert starts == list(range(len(starts)))
    assert len(starts) >= (work.die.starts if work.recipe.method.exact else 0)
    hull, directions = told[-1]
    np.testing.assert_array_equal(hull.vertices, work.die.hull.vertices)
    np.testing.assert_array_equal(directions, work.die.directions)
    for (hull, directions), error in zip(told, errors, strict=True):
        probabilities = outcome_probabilities(rest_poses(hull.vertices), directions)
        if probabilities.elsewhere < 1e-12 and (probabilities.rest_counts == 1).all():
            found = np.abs(probabilities.probabilities - recipe.target.target().probabilities).max()
            assert found == pytest.approx(error, abs=1e-9)


class Enough(BaseException):
    """Nobody wants more."""


def test_what_a_listener_raises_ends_the_run() -> None:
    shapes = []

    def seen(*shape: Any) -> None:
        shapes.append(shape)
        if len(shapes) == 3:
            raise Enough

    recipe = parse_recipe({"name": "d5", "target": {"fair": 5}})
    with pytest.raises(Enough):
        design_recipe(recipe, Callbacks(on_shape=seen), last="design")
    assert len(shapes) == 3
