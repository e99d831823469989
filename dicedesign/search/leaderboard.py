"""Leaderboard of a search: ranking and files."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from dicedesign.recipe.reading import parse_recipe, recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.report.curve_charts import pareto_chart
from dicedesign.report.pages import leaderboard_page
from dicedesign.results.folder import remove_files
from dicedesign.runtime.arrays import Booleans, Floats
from dicedesign.runtime.files import json_text, write_files
from dicedesign.search.study import varies_assignment

Finished = dict[str, Any]
"""Finished trial, as in `dicedesign.search.study.SearchStudy.finished`."""

LEADERS = 10
"""Number of dice on the leaderboard, besides the best in each measure."""

BEST = "best.yaml"

TABLE = "leaderboard.json"

COLUMNS = (
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
"""Columns of leaderboard.csv, before the columns of the varied entries."""


def pareto_front(points: Floats) -> Booleans:
    """Pareto-optimal points (n, d), as (n,): no other is at least as large in all coordinates, and
    larger in one."""
    at_least = np.all(points[None] >= points[:, None], axis=-1)
    larger = np.any(points[None] > points[:, None], axis=-1)
    dominated: Booleans = np.any(at_least & larger, axis=1)
    return ~dominated


def rank_trials(finished: Sequence[Finished]) -> list[Finished]:
    """Sort the converged trials, the best first, by the product of inradius and margin, then by
    error and number. No die comes after one that is worse in both."""
    return sorted(
        (trial for trial in finished if trial["status"] == "converged"),
        key=lambda trial: (
            -trial["inradius_mm"] * trial["margin_deg"],
            trial["max_abs_error"],
            trial["number"],
        ),
    )


def leaders(finished: Sequence[Finished]) -> list[Finished]:
    """First `LEADERS` of the ranked trials, and the trials with the largest inradius, the largest
    margin and the smallest error."""
    order = rank_trials(finished)
    if not order:
        return []
    single = [
        max(order, key=itemgetter("inradius_mm")),
        max(order, key=itemgetter("margin_deg")),
        min(order, key=itemgetter("max_abs_error")),
    ]
    chosen = {trial["number"] for trial in (*order[:LEADERS], *single)}
    return [trial for trial in order if trial["number"] in chosen]


def write_results(folder: Path, recipe: Recipe, finished: Sequence[Finished]) -> list[Finished]:
    """Write the leaderboard, its chart and the recipes of the best; returns the leaderboard.

    All files are written or none, and leaderboard.json last. Raises OutputError.
    """
    solved = rank_trials(finished)
    values = np.array([[trial["inradius_mm"], trial["margin_deg"]] for trial in solved])
    on_front = pareto_front(values.reshape(-1, 2))
    front = set(itertools.compress((trial["number"] for trial in solved), on_front))
    chosen = {trial["number"] for trial in leaders(finished)}
    columns = ("number", "inradius_mm", "margin_deg", "max_abs_error", "asymmetry", "seconds")
    files: dict[str, bytes] = {}
    board = []
    for rank, trial in enumerate(solved, start=1):
        number, entries = trial["number"], trial["recipe"]
        if number not in chosen:
            continue
        varied: dict[str, Any] = {"seed": entries["seed"]}
        if varies_assignment(recipe):
            varied["assignment"] = entries["assignment"]
        if recipe.method.exact is not None:
            for name, weight in entries["method"]["exact"]["prefer"].items():
                varied[f"method.exact.prefer.{name}"] = weight
        board.append(
            {
                "rank": rank,
                **{key: trial[key] for key in columns},
                "on_front": number in front,
                "as_given": entries == recipe.as_dict(),
                "varied": varied,
                "recipe_file": f"trial_{number}.yaml",
            }
        )
        named = parse_recipe({**entries, "name": f"{recipe.name[:80]}_trial_{number}"})
        files[f"trial_{number}.yaml"] = recipe_text(named).encode("utf-8")
        files.setdefault(BEST, files[f"trial_{number}.yaml"])
    chart = pareto_chart(finished, front, [entry["number"] for entry in board]).png()
    table: dict[str, Any] = {
        "name": recipe.name,
        "size_mm": recipe.size_mm,
        "trials": len(finished),
        "converged": len(solved),
        "front": sorted(front),
        "leaderboard": board,
    }
    keys = list(board[0]["varied"]) if board else []
    rows = [{**entry, **entry["varied"]} for entry in board]
    shapes = {trial["number"]: trial for trial in solved}
    files |= {
        "pareto.png": chart,
        "leaderboard.html": leaderboard_page(table, shapes, chart).encode("utf-8"),
        "leaderboard.csv": csv_text([*COLUMNS, *keys], rows).encode("utf-8"),
        TABLE: json_text(table).encode("utf-8"),
    }
    old = [path.name for path in (folder / BEST, *folder.glob("trial_*.yaml"))]
    remove_files(folder, [TABLE, *(name for name in old if name not in files)])
    write_files({folder / name: data for name, data in files.items()})
    return board


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Text of a CSV file; lists become texts with commas."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        cells = (row[column] for column in columns)
        writer.writerow(", ".join(cell) if isinstance(cell, list) else cell for cell in cells)
    return text.getvalue()
