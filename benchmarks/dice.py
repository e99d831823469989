"""Recipes made into dice; no other bench knows the stages of a run."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dicedesign import InputError, Recipe, Step, read_recipe
from dicedesign.recipe.pipeline import Listeners, Work, run_stages
from dicedesign.starts import Start

__all__ = ["Work", "add_recipes", "begin", "continue_to", "make_die", "read_recipes", "start_of"]


def begin(recipe: Recipe, on_step: Callable[[Step], None] | None = None) -> Work:
    """The work of a recipe whose start, or surface, is made; nothing will be written."""
    work = Work(recipe, None, Listeners() if on_step is None else Listeners(on_step=on_step))
    run_stages(work, last="start")
    return work


def continue_to(work: Work, last: str, after: str) -> None:
    """Run the stages behind one, up to another."""
    run_stages(work, after=after, last=last)


def make_die(recipe: Recipe, last: str = "check") -> Work:
    """The work of a recipe up to and with a stage. Raises NoStartError where nothing leads there,
    InputError where the start does not suit the target."""
    work = Work(recipe, None, Listeners())
    run_stages(work, last=last)
    return work


def start_of(recipe: Recipe) -> Start:
    """The start that all methods share. Raises InputError where shapes are searched."""
    start = begin(recipe).start
    if start is None:
        raise InputError(
            f"{recipe.name}: expected a start that all methods can share, got a search or a "
            "surface; give it another start, or leave it out"
        )
    return start


def with_method(recipe: Recipe, **options: Any) -> Recipe:
    """The recipe with other options of its methods, by the methods' names; None leaves one out."""
    return recipe.model_copy(update={"method": recipe.method.model_copy(update=options)})


def add_recipes(parser: argparse.ArgumentParser, nargs: str = "+") -> None:
    """The argument `recipes`."""
    parser.add_argument("recipes", nargs=nargs, type=Path, metavar="RECIPE.yaml")


def read_recipes(options: argparse.Namespace) -> list[Recipe]:
    """All of them; what is wrong with one is said before anything is designed."""
    return [read_recipe(path) for path in options.recipes]
