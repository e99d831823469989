"""Leaderboard: ranking, Pareto front and files."""

from __future__ import annotations

import csv
import json
import re
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.drawings import is_whole
from common.parsed_html import parse_page

from dicedesign.recipe.reading import parse_recipe, read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.report.curve_charts import pareto_chart
from dicedesign.search.leaderboard import leaders, pareto_front, rank_trials, write_results

TETRAHEDRON = [[9.0, 9.0, 9.0], [9.0, -9.0, -9.0], [-9.0, 9.0, -9.0], [-9.0, -9.0, 9.0]]


def make_trials(recipe: Recipe, count: int, seed: int = 0) -> list[dict[str, Any]]:
    """Make trials with random measures and ties, some of them not converged."""
    rng = np.random.default_rng(seed)
    trials = []
    for number in range(count):
        kind = rng.choice(["converged", "no_progress", "no_die"], p=[0.7, 0.2, 0.1])
        has_no_die = kind == "no_die"
        trials.append(
            {
                "number": number,
                "recipe": {**recipe.as_dict(), "seed": 3 + number},
                "status": str(kind),
                "message": "",
                "max_abs_error": None if has_no_die else float(rng.integers(1, 5) * 1e-14),
                "inradius_mm": None if has_no_die else float(rng.integers(1, 12)) / 4.0,
                "margin_deg": None if has_no_die else float(rng.integers(1, 12)),
                "asymmetry": None if has_no_die else float(rng.random()),
                "vertices": None if has_no_die else TETRAHEDRON,
                "down": None if has_no_die else [3**-0.5, 3**-0.5, -(3**-0.5)],
                "seconds": 0.5,
            }
        )
    return trials


@pytest.mark.parametrize("seed", range(2))
def test_the_front_against_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 6, size=(40, 2 + seed % 2)).astype(float)
    front = pareto_front(points)
    for point, is_on in zip(points.tolist(), front, strict=True):
        is_dominated = any(
            all(b >= a for a, b in zip(point, other, strict=True)) and other != point
            for other in points.tolist()
        )
        assert is_on == (not is_dominated)


@pytest.mark.parametrize("seed", range(2))
def test_the_order_against_brute_force(recipe: Recipe, seed: int) -> None:
    trials = make_trials(recipe, 60, seed)
    order = rank_trials(trials)
    assert {t["number"] for t in order} == {
        t["number"] for t in trials if t["status"] == "converged"
    }

    for first, second in combinations(order, 2):
        (r, m), (s, n) = ((t["inradius_mm"], t["margin_deg"]) for t in (first, second))
        assert r * m >= s * n
        # No die comes after one that it dominates.
        assert not (s > r and n > m)
        if r * m == s * n:
            ties = [(t["max_abs_error"], t["number"]) for t in (first, second)]
            assert ties == sorted(ties)
    board = leaders(trials)
    assert board[:10] == order[:10]
    assert len(board) <= 13
    solved = [t for t in trials if t["status"] == "converged"]
    for best, key in ((max, "inradius_mm"), (max, "margin_deg"), (min, "max_abs_error")):
        assert best(t[key] for t in board) == best(t[key] for t in solved)


def test_the_files(tmp_path: Path, recipe: Recipe) -> None:
    trials = make_trials(recipe, 30)
    folder = tmp_path / "out"
    folder.mkdir()
    board = write_results(folder, recipe, trials)
    numbers = [entry["number"] for entry in board]
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [
            "best.yaml",
            "leaderboard.csv",
            "leaderboard.html",
            "leaderboard.json",
            "pareto.png",
            *(f"trial_{number}.yaml" for number in numbers),
        ]
    )
    table = json.loads((folder / "leaderboard.json").read_text())
    assert table["leaderboard"] == board
    assert table["trials"] == 30
    assert [entry["as_given"] for entry in board] == [number == 0 for number in numbers]
    assert table["converged"] == len(rank_trials(trials))
    assert [entry["number"] for entry in board if entry["on_front"]] == [
        number for number in numbers if number in table["front"]
    ]
    with (folder / "leaderboard.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["number"]) for row in rows] == numbers
    assert [float(row["margin_deg"]) for row in rows] == [entry["margin_deg"] for entry in board]

    text = (folder / "leaderboard.html").read_text()
    page = parse_page(text)
    assert len(page.sources) == len(board) + 1
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    assert not re.search(r"https?:|<(?:script|link|iframe)", text)
    assert all(entry["recipe_file"] in page.text for entry in board)
    assert f"{table['converged']} of 30 trials converged" in page.text

    for entry in board:
        again = read_recipe(folder / entry["recipe_file"])
        assert again.seed == 3 + entry["number"]
        assert again.name == f"four_trial_{entry['number']}"
    assert (folder / "best.yaml").read_text() == (folder / board[0]["recipe_file"]).read_text()

    # A later leaderboard replaces all files.
    later = write_results(folder, recipe, [{**trial, "status": "no_progress"} for trial in trials])
    assert later == []
    assert not list(folder.glob("trial_*.yaml"))
    assert not (folder / "best.yaml").exists()
    assert "there is no die to show" in (folder / "leaderboard.html").read_text()


@pytest.mark.parametrize("is_assigned", [True, False])
def test_varied_assignments_are_listed(tmp_path: Path, is_assigned: bool) -> None:
    entries = {"name": "die", "start": {"prism": {"sides": 3}}, "method": {"paper": {}}}
    recipe = parse_recipe({**entries, "target": {"binomial": 2} if is_assigned else {"fair": 3}})
    for entry in write_results(tmp_path, recipe, make_trials(recipe, 6)):
        assert ("assignment" in entry["varied"]) == is_assigned


def test_the_chart_distinguishes_kinds_of_trials(recipe: Recipe) -> None:
    trials = make_trials(recipe, 60)
    solved = rank_trials(trials)
    values = np.array([[trial["inradius_mm"], trial["margin_deg"]] for trial in solved])
    front = [t["number"] for t, on in zip(solved, pareto_front(values), strict=True) if on]
    named = [trial["number"] for trial in solved[:10]]
    sheet = pareto_chart(trials, front, named)
    (axes,) = sheet.figure.axes
    steps, *groups = axes.lines
    kinds = [trial["status"] for trial in trials]
    missed, converged, best = (len(group.get_xdata()) for group in groups[:3])
    assert (missed, best) == (kinds.count("no_progress"), len(front))
    assert converged + best == kinds.count("converged")
    # The steps are an upper bound of all dice.
    x, y = np.asarray(steps.get_xydata()).T
    for radius, margin in values:
        assert margin <= y[np.searchsorted(x, radius)]
    assert axes.texts[0].get_text() == str(solved[0]["number"])
    assert is_whole(sheet)
