"""The best dice of a search, and the files that tell about them."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from dicedesign.errors import OutputError
from dicedesign.recipe.schema.reading import checked_recipe, recipe_text
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.runtime.arrays import Booleans, Floats
from dicedesign.runtime.files import atomic_write, json_text
from dicedesign.search.space import varies_assignment

__all__ = ["leaders", "pareto_front", "ranked", "write_results"]

Finished = dict[str, Any]
"""One trial, as in `dicedesign.search.study.SearchStudy.finished`."""

LEADERS: Final = 10
"""Dice on the leaderboard; the best in each single measure are added."""

BEST: Final = "best.yaml"

TABLE: Final = "leaderboard.json"

COLUMNS: Final = (
    "rank",
    "number",
    "inradius_mm",
    "margin_deg",
    "max_abs_error",
    "asymmetry",
    "on_front",
    "seconds",
    "recipe_file",
)
"""Of the table in leaderboard.csv; what was varied follows."""


def pareto_front(points: Floats) -> Booleans:
    """(n,) whether no other of the points (n, d) is at least as large in all and larger in one."""
    no_less = np.all(points[None] >= points[:, None], axis=-1)
    larger = np.any(points[None] > points[:, None], axis=-1)
    beaten: Booleans = np.any(no_less & larger, axis=1)
    return ~beaten


def ranked(finished: Sequence[Finished]) -> list[Finished]:
    """The trials that converged, the best first: by the product of the smallest circle's radius and
    the margin, then by error, then by number. No die comes after one that is worse in both."""
    return sorted(
        (trial for trial in finished if trial["status"] == "converged"),
        key=lambda trial: (
            -trial["inradius_mm"] * trial["margin_deg"],
            trial["max_abs_error"],
            trial["number"],
        ),
    )


def leaders(finished: Sequence[Finished]) -> list[Finished]:
    """The first `LEADERS` of the ranked trials, and those with the largest circle, the largest
    margin and the smallest error where these come later."""
    order = ranked(finished)
    if not order:
        return []
    single = [
        max(order, key=lambda trial: trial["inradius_mm"]),
        max(order, key=lambda trial: trial["margin_deg"]),
        min(order, key=lambda trial: trial["max_abs_error"]),
    ]
    chosen = {trial["number"] for trial in (*order[:LEADERS], *single)}
    return [trial for trial in order if trial["number"] in chosen]


def write_results(folder: Path, recipe: Recipe, finished: Sequence[Finished]) -> list[Finished]:
    """Write the leaderboard, the picture and the recipes of the best; returns the leaderboard.

    Each file appears whole or not at all, and leaderboard.json last.

    Raises OutputError if a file cannot be written.
    """
    from dicedesign.report.charts.pareto import pareto_figure
    from dicedesign.report.pages.leaderboard_page import leaderboard_html

    solved = ranked(finished)
    values = np.array([[trial["inradius_mm"], trial["margin_deg"]] for trial in solved])
    on_front = pareto_front(values.reshape(-1, 2))
    front = {trial["number"] for trial, is_on in zip(solved, on_front, strict=True) if is_on}
    chosen = {trial["number"] for trial in leaders(finished)}
    board = [
        _entry(rank, trial, trial["number"] in front, recipe)
        for rank, trial in enumerate(solved, start=1)
        if trial["number"] in chosen
    ]
    picture = pareto_figure(finished, front, [entry["number"] for entry in board]).png()
    table = {
        "name": recipe.name,
        "size_mm": recipe.size_mm,
        "trials": len(finished),
        "converged": len(solved),
        "front": sorted(front),
        "leaderboard": board,
    }
    shapes = {trial["number"]: trial for trial in solved}
    files = {
        "pareto.png": picture,
        "leaderboard.html": leaderboard_html(table, shapes, picture).encode("utf-8"),
        "leaderboard.csv": _csv(board).encode("utf-8"),
    }
    for entry in board:
        text = recipe_text(_named(recipe, shapes[entry["number"]]))
        files[entry["recipe_file"]] = text.encode("utf-8")
        if entry["rank"] == 1:
            files[BEST] = files[entry["recipe_file"]]
    files[TABLE] = json_text(table).encode("utf-8")
    _remove_old(folder, set(files))
    for name, data in files.items():
        atomic_write(folder / name, data)
    return board


def _entry(rank: int, trial: Finished, on_front: bool, recipe: Recipe) -> dict[str, Any]:
    number = trial["number"]
    kept = ("number", "inradius_mm", "margin_deg", "max_abs_error", "asymmetry", "seconds")
    return {
        "rank": rank,
        **{key: trial[key] for key in kept},
        "on_front": on_front,
        "as_given": trial["recipe"] == recipe.resolved(),
        "varied": _varied(recipe, trial["recipe"]),
        "recipe_file": f"trial_{number}.yaml",
    }


def _varied(recipe: Recipe, entries: dict[str, Any]) -> dict[str, Any]:
    """Varied entries of the recipe of one trial, by their keys."""
    varied: dict[str, Any] = {"seed": entries["seed"]}
    if varies_assignment(recipe):
        varied["assignment"] = entries["assignment"]
    if recipe.method.exact is not None:
        for name, weight in entries["method"]["exact"]["prefer"].items():
            varied[f"method.exact.prefer.{name}"] = weight
    return varied


def _named(recipe: Recipe, trial: Finished) -> Recipe:
    """The recipe of a trial under a name of its own."""
    return checked_recipe(
        {**trial["recipe"], "name": f"{recipe.name[:80]}_trial_{trial['number']}"}
    )


def _csv(board: Sequence[dict[str, Any]]) -> str:
    varied = list(board[0]["varied"]) if board else []
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*COLUMNS, *varied])
    for entry in board:
        changed = [
            ", ".join(value) if isinstance(value, list) else value
            for value in entry["varied"].values()
        ]
        writer.writerow([*(entry[column] for column in COLUMNS), *changed])
    return text.getvalue()


def _remove_old(folder: Path, written: set[str]) -> None:
    """The table and recipes of an earlier leaderboard that are not written again."""
    try:
        (folder / TABLE).unlink(missing_ok=True)
        for path in (folder / BEST, *folder.glob("trial_*.yaml")):
            if path.name not in written:
                path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: expected old results that can be removed, but {error.strerror}; choose "
            "another folder with --out"
        ) from error
