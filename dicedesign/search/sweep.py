"""Sweep of a recipe: a die for each combination of some values, in folders side by side."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Final

import numpy as np

from dicedesign.errors import DiceError, RecipeError
from dicedesign.geometry.meshes.reading import read_stl
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe, parse_yaml, read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.folder import CHECKPOINT, RECIPE, read_result
from dicedesign.results.result import RESULT
from dicedesign.runtime.files import write_files
from dicedesign.runtime.workers import is_lost_worker, iterate_completed
from dicedesign.search.leaderboard import csv_text
from dicedesign.search.trials import measure_facets

LONGEST: Final = 60
"""Most characters of a subfolder's name."""

PAGE: Final = "index.html"

TABLE: Final = "sweep.csv"

COLUMNS: Final = (
    "folder",
    "status",
    "max_abs_error",
    "inradius_mm",
    "margin_deg",
    "asymmetry",
    "seconds",
    "message",
)
"""Columns of sweep.csv, before the columns of the varied keys."""

Combinations = Mapping[str, tuple[Mapping[str, Any], Recipe]]
"""Values and recipe of each combination, by the name of its subfolder."""


def combine(path: Path, settings: Sequence[str]) -> Combinations:
    """Recipes of all combinations of values.

    path: of the YAML recipe; settings: texts "dotted.key=value,value,...", values in YAML: commas
    within brackets, braces or quotes do not part them.

    Raises RecipeError if a setting or one of the recipes is invalid, or two are the same.
    """
    keys: list[str] = []
    choices: list[Sequence[Any]] = []
    for setting in settings:
        key, equals, text = setting.partition("=")
        values: Any = parse_yaml(f"[{text}]", f"--set {key}")
        if not equals or not key.strip() or key.strip() in keys or not values:
            raise RecipeError(
                f"--set {setting}: expected a key of its own and its values; write it such as "
                "size_mm=20,30,40"
            )
        keys.append(key.strip())
        choices.append(values)
    recipes: list[Recipe] = []
    combinations: dict[str, tuple[dict[str, Any], Recipe]] = {}
    for chosen in itertools.product(*choices):
        varied = dict(zip(keys, chosen, strict=True))
        texts = {key: json.dumps(value, default=str) for key, value in varied.items()}
        recipe = read_recipe(path, [f"{key}={text}" for key, text in texts.items()])
        parts = (f"{key.rpartition('.')[2]}-{text}" for key, text in texts.items())
        name = re.sub(r"[^\w.]+", "-", "_".join(parts)).strip("-.")[:LONGEST]
        if recipe in recipes:
            raise RecipeError(f"--set: expected combinations that differ, got {varied} twice")
        if name in combinations:
            name += f"_{len(combinations) + 1}"
        recipes.append(recipe)
        named = recipe.as_dict() | {"name": f"{recipe.name[:80]}_{name}"}
        combinations[name] = varied, parse_recipe(named)
    return combinations


def is_made(folder: Path, recipe: Recipe) -> bool:
    """Whether a folder has the result of a recipe."""
    try:
        return (folder / RESULT).exists() and read_recipe(folder / RECIPE) == recipe
    except DiceError:
        return False


def make_dice(
    folder: Path,
    combinations: Combinations,
    executor: Executor,
    jobs: int,
    on_die: Callable[[], None],
) -> dict[str, str]:
    """Make the dice of combinations, `jobs` at a time, each in its subfolder.

    executor: processes or machines that write into the folder. on_die: called after each die.

    Returns messages by subfolder of those that cannot be made.
    """
    faults: dict[str, str] = {}
    names = iter(combinations)
    for name, future in iterate_completed(
        lambda: next(names, None),
        lambda name: executor.submit(_make, combinations[name][1].as_dict(), folder / name),
        jobs,
    ):
        try:
            fault = future.result()
        except Exception as error:
            if not is_lost_worker(error):
                raise
            fault = "its worker was lost; see whether memory suffices, and repeat the command"
        if fault is not None:
            faults[name] = fault
        on_die()
    return faults


def _make(entries: Mapping[str, Any], folder: Path) -> str | None:
    """Make a die, or resume it. Returns a message if that is impossible."""
    try:
        run(entries, folder, resume=(folder / CHECKPOINT).exists())
    except DiceError as error:
        return str(error)
    return None


def write_sweep(
    folder: Path, title: str, combinations: Combinations, faults: Mapping[str, str]
) -> list[dict[str, Any]]:
    """Write the page and the table of a sweep; returns the rows of the table.

    faults: messages of the combinations that cannot be made. Raises OutputError.
    """
    # Only the page needs a renderer.
    from dicedesign.report.pages import sweep_page

    rows, solids = [], {}
    for name, (varied, recipe) in combinations.items():
        row: dict[str, Any] = dict.fromkeys(COLUMNS) | {"folder": name}
        if name in faults:
            row |= {"status": "failed", "message": faults[name]}
        elif not is_made(folder / name, recipe):
            row |= {"status": "not made"}
        else:
            result = read_result(folder / name)
            faces = len(recipe.target.target().face_labels)
            row |= {"status": result.status, "asymmetry": result.asymmetry}
            row["message"] = result.message.splitlines()[0]
            errors = np.abs(np.subtract(result.printed_probabilities, result.target))
            row["max_abs_error"] = float(errors.max())
            row["seconds"] = sum(stage.seconds for stage in result.stages)
            row |= measure_facets(result, faces)
            solid = read_stl((folder / name / result.files["die_plain"]).read_bytes()).surface
            solids[name] = solid, -np.array(result.facets[0].normal)
        rows.append({**row, **varied})
    keys = list(next(iter(combinations.values()))[0])
    texts = {TABLE: csv_text([*COLUMNS, *keys], rows), PAGE: sweep_page(title, rows, keys, solids)}
    write_files({folder / name: text.encode("utf-8") for name, text in texts.items()})
    return rows
