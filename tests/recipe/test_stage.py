"""Stages of a run, and one that somebody adds."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from dicedesign.geometry.solid import solid_properties
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import STAGES, Stage
from dicedesign.recipe.reading import checked_recipe
from dicedesign.recipe.work import Work

RECIPE = {"name": "x", "target": {"fair": 3}, "engrave": False, "start": {"prism": {}}}


def weigh(work: Work) -> None:
    """A note of what a die of 1.2 g/cm3 weighs."""
    volume, _ = solid_properties(work.solid.points, work.solid.triangles)
    work.notes.append(f"it weighs {1.2e-3 * volume:.1f} g")


@pytest.fixture
def weighing() -> Iterator[Stage]:
    """Before engraving, of dice that are larger than 20 mm."""
    yield STAGES.register(
        Stage(
            name="weigh",
            line="says what the die weighs",
            after="check",
            wanted=lambda work: work.recipe.size_mm > 20.0,
            run=weigh,
        )
    )
    STAGES.unregister("weigh")


def test_a_stage_from_outside_has_its_turn(weighing: Stage) -> None:
    work = design_recipe(checked_recipe(RECIPE))
    names = [stage["name"] for stage in work.clock.stages]
    assert names == ["start", "load", "design", "export", "check", "weigh"]
    assert work.result().notes[-1].startswith("it weighs ")
    small = design_recipe(checked_recipe({**RECIPE, "size_mm": 15}))
    assert [stage["name"] for stage in small.clock.stages][-1] == "check"
