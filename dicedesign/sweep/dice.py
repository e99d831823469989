"""Dice of all combinations of some values of a recipe, each in a folder of its own."""

from __future__ import annotations

import itertools
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dicedesign.errors import (
    CheckpointError,
    DiceError,
    NoStartError,
    OutsideHullError,
    RecipeError,
)
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe, parse_yaml, read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.folder import CHECKPOINT, RECIPE, read_result
from dicedesign.results.result import Result
from dicedesign.runtime.outputs import UNFINISHED
from dicedesign.runtime.workers import LONE_RUNS, run_in_batches

MAX_FOLDER_NAME = 60
"""Characters of a subfolder's name."""


@dataclass(frozen=True)
class Combination:
    """Die of a sweep.

    Attributes
    ----------
    varied: values of the varied keys, by key.
    recipe: recipe with these values, and a name of its own.
    """

    varied: Mapping[str, Any]
    recipe: Recipe


def combine(
    path: Path, settings: Sequence[str], seeds: int | None = None
) -> dict[str, Combination]:
    """All combinations of values, by the name of the subfolder of each.

    Parameters
    ----------
    path: of the YAML recipe.
    settings: texts "dotted.key=value,value,...", values in YAML: commas within brackets, braces or
        quotes do not part them.
    seeds: number of values of the key seed, from 0 on.

    Raises RecipeError if a setting or one of the recipes is invalid, or two are the same.
    """
    choices: dict[str, Sequence[Any]] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        values: Any = parse_yaml(f"[{text}]", f"--set {key}")
        if not equals or not key.strip() or key.strip() in choices or not values:
            raise RecipeError(
                f"--set {setting}: expected a key of its own and its values; write it such as "
                "size_mm=20,30,40"
            )
        choices[key.strip()] = values
    if seeds is not None:
        if "seed" in choices:
            raise RecipeError(
                "--set seed: expected none with --seeds, got both; leave one of them out"
            )
        choices["seed"] = range(seeds)
    if not choices:
        raise RecipeError(
            "--set: expected it, or --seeds, got none; write such as --seeds 20 or --set "
            "size_mm=20,30"
        )
    combinations: dict[str, Combination] = {}
    recipes: list[Recipe] = []
    for chosen in itertools.product(*choices.values()):
        varied = dict(zip(choices, chosen, strict=True))
        texts = {key: json.dumps(value, default=str) for key, value in varied.items()}
        recipe = read_recipe(path, [f"{key}={text}" for key, text in texts.items()])
        if recipe in recipes:
            raise RecipeError(
                f"--set: expected combinations that differ, got {varied} twice; leave one out"
            )
        recipes.append(recipe)
        parts = (f"{key.rpartition('.')[2]}-{text}".replace('"', "") for key, text in texts.items())
        name = re.sub(r"[^\w.]+", "-", "_".join(parts)).strip("-.")[:MAX_FOLDER_NAME]
        if name in combinations:
            name += f"_{len(combinations) + 1}"
        named = recipe.as_dict() | {"name": f"{recipe.name[:80]}_{name}"}
        combinations[name] = Combination(varied, parse_recipe(named))
    return combinations


def check_starts(combinations: Mapping[str, Combination]) -> None:
    """Raise DiceError for a start that suits no seed, before any die is made."""
    for combination in combinations.values():
        try:
            design_recipe(combination.recipe, last="start")
        except (NoStartError, OutsideHullError):
            # Another seed may have one.
            continue


def made_die(folder: Path, recipe: Recipe) -> Result | None:
    """Result of a recipe that is complete and unchanged in a folder; None if it must be made, also
    after a process was killed while it wrote the last files."""
    if os.path.lexists(folder / UNFINISHED):
        return None
    try:
        if read_recipe(folder / RECIPE) != recipe:
            return None
        result = read_result(folder)
    except DiceError:
        return None
    return None if result.changes() else result


def make_dice(
    folder: Path,
    combinations: Mapping[str, Combination],
    executor: Executor,
    jobs: int,
    on_die: Callable[[], object],
    inputs: Sequence[Path] = (),
) -> dict[str, str]:
    """Make the dice of combinations, each in its subfolder. Dice of lost workers are made again at
    the end, one at a time.

    executor: processes or machines that write into the folder; jobs: number of workers. on_die:
    called after each die. inputs: as in `run`.

    Returns messages by subfolder of those that cannot be made.
    """
    faults: dict[str, str] = {}

    def on_result(fault: dict[str, str]) -> None:
        faults.update(fault)
        on_die()

    lost = run_in_batches(
        list(combinations),
        lambda names: executor.submit(
            _make, folder, {name: combinations[name].recipe.as_dict() for name in names}, inputs
        ),
        jobs,
        on_result,
        items_per_task=1,
    )
    reason = f"all {LONE_RUNS} workers that made it were lost; see whether memory suffices"
    return faults | dict.fromkeys(lost, reason)


def _make(
    folder: Path, recipes: Mapping[str, Mapping[str, Any]], inputs: Sequence[Path]
) -> dict[str, str]:
    """Make or resume dice. Returns messages by subfolder of those that cannot be made."""
    faults = {}
    for name, entries in recipes.items():
        try:
            try:
                resume = (folder / name / CHECKPOINT).exists()
                run(entries, folder / name, resume=resume, inputs=inputs)
            except CheckpointError:
                # It is of an earlier recipe.
                run(entries, folder / name, inputs=inputs)
        except DiceError as error:
            faults[name] = str(error)
    return faults
