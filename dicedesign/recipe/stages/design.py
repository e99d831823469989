"""Stages load and design: the recipe's method makes a die."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.runtime.workers import one_tensor_thread

__all__ = ["run_method"]


def run_method(work: Work) -> None:
    """Design the die of a recipe, in the file of its method in `dicedesign.recipe.methods`. Raises
    as the method."""
    with one_tensor_thread():
        work.die = _method(work).design(work)


def _method(work: Work) -> Any:
    """The module of the recipe's method, which brings torch along."""
    method = work.recipe.method
    name = "thrown" if method.thrown else method.name
    return import_module(f"dicedesign.recipe.methods.{name}")


STAGES.register(
    Stage(
        name="load",
        line="loads the solver of the recipe's method, and torch with it, if that is not there yet",
        rank=15,
        wanted=lambda work: True,
        run=_method,
    )
)


STAGES.register(
    Stage(
        name="design",
        line="runs the recipe's method: exact, paper, concave, or exact for thrown dice",
        rank=20,
        wanted=lambda work: True,
        run=run_method,
    )
)
