"""Recipes made into dice; no other file of the benches knows the stages of a run."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dicedesign.errors import EngravingError
from dicedesign.recipe.planning.stage import plan
from dicedesign.recipe.planning.work import Listeners, Work
from dicedesign.recipe.schema.recipe import Recipe

if TYPE_CHECKING:
    from dicedesign.results.result import Result, Step
    from dicedesign.throws.simulation import DieOnTable

__all__ = ["Work", "begun", "checked", "designed", "engraved", "on_table", "with_method"]


def with_method(recipe: Recipe, **options: Any) -> Recipe:
    """The recipe with other options of its methods, by the methods' names; None leaves one out."""
    return recipe.model_copy(update={"method": recipe.method.model_copy(update=options)})


def begun(recipe: Recipe, on_step: Callable[[Step], None] | None = None) -> Work:
    """The work of a recipe whose start, or surface, is made; nothing will be written.

    on_step: called after each accepted step of the design. Raises InputError if the start cannot be
    used.
    """
    work = Work(recipe, None, Listeners() if on_step is None else Listeners(on_step=on_step))
    plan(work, last="start")
    return work


def designed(work: Work) -> float:
    """Design the die, and return the seconds on the wall that it took.

    Raises InputError if the start does not suit the target, NoStartError where none leads there.
    """
    started = time.perf_counter()
    plan(work, after="start", last="design")
    return time.perf_counter() - started


def checked(work: Work) -> Result:
    """What a designed die does, by the content of the file that it makes."""
    plan(work, after="design", last="check")
    return work.result()


def engraved(work: Work) -> bool:
    """Cut the labels into a checked die, and return whether it has them: they may not be wanted,
    or not fit."""
    try:
        plan(work, after="check", last="engrave")
    except EngravingError:
        return False
    return work.engraved is not None


def on_table(work: Work) -> DieOnTable:
    """A die as it is printed, with labels if it has them, on the table of its recipe."""
    from dicedesign.throws.simulation import DieOnTable
    from dicedesign.throws.tables import table_named

    assert work.recipe.method.exact is not None
    engraved = None if work.engraved is None else work.engraved.assessment
    body, center = (engraved or work.plain).body, work.solid.center_of_mass
    return DieOnTable.of(
        body, center, work.die.directions, table_named(work.recipe.method.exact.thrown_onto)
    )
