"""Callbacks of a run receive shapes and steps, and can end it."""

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
    shapes, errors, starts = [], [], []
    callbacks = Callbacks(
        on_start=starts.append,
        on_shape=lambda *shape: shapes.append(shape),
        on_step=lambda step: errors.append(step.max_abs_error),
    )
    work = design_recipe(recipe, callbacks, last="design")
    assert len(shapes) == len(errors) == len(work.die.steps)
    assert starts == list(range(len(starts)))
    assert len(starts) >= (work.die.starts if work.recipe.method.exact else 0)
    hull, directions = shapes[-1]
    np.testing.assert_array_equal(hull.vertices, work.die.hull.vertices)
    np.testing.assert_array_equal(directions, work.die.directions)
    for (hull, directions), error in zip(shapes, errors, strict=True):
        outcomes = outcome_probabilities(rest_poses(hull.vertices), directions)
        if outcomes.elsewhere < 1e-12 and (outcomes.rest_counts == 1).all():
            computed = outcomes.max_abs_error(recipe.target.target().probabilities)
            assert computed == pytest.approx(error, abs=1e-9)


class Enough(BaseException):
    """Exception of a callback."""


def test_an_exception_of_a_callback_ends_the_run() -> None:
    shapes = []

    def on_shape(*shape: Any) -> None:
        shapes.append(shape)
        if len(shapes) == 3:
            raise Enough

    recipe = parse_recipe({"name": "d5", "target": {"fair": 5}})
    with pytest.raises(Enough):
        design_recipe(recipe, Callbacks(on_shape=on_shape), last="design")
    assert len(shapes) == 3
