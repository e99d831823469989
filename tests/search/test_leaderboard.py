"""The order of the best dice, the front, and the files that tell of them."""

from __future__ import annotations

import csv
import json
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.drawings import is_whole
from PIL import Image

from dicedesign import rest_poses
from dicedesign.recipe.reading import checked_recipe, read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.report.curve_charts import pareto_chart
from dicedesign.report.pages import lying_die_png
from dicedesign.search.leaderboard import leaders, pareto_front, ranked, write_results
from dicedesign.search.study import search_space, varied_recipe
from dicedesign.search.trials import run_trial

TETRAHEDRON = [[9.0, 9.0, 9.0], [9.0, -9.0, -9.0], [-9.0, 9.0, -9.0], [-9.0, -9.0, 9.0]]


def made(recipe: Recipe, count: int, seed: int = 0) -> list[dict[str, Any]]:
    """Trials with random measures, a few of each kind that did not converge, and ties."""
    rng = np.random.default_rng(seed)
    trials = []
    for number in range(count):
        kind = rng.choice(["converged", "no_progress", "no_die"], p=[0.7, 0.2, 0.1])
        dead = kind == "no_die"
        trials.append(
            {
                "number": number,
                "recipe": {**recipe.resolved(), "seed": 3 + number},
                "status": str(kind),
                "message": "",
                "max_abs_error": None if dead else float(rng.integers(1, 5) * 1e-14),
                "inradius_mm": None if dead else float(rng.integers(1, 12)) / 4.0,
                "margin_deg": None if dead else float(rng.integers(1, 12)),
                "asymmetry": None if dead else float(rng.random()),
                "vertices": None if dead else TETRAHEDRON,
                "down": None if dead else [3**-0.5, 3**-0.5, -(3**-0.5)],
                "seconds": 0.5,
            }
        )
    return trials


@pytest.mark.parametrize("seed", range(2))
def test_the_front_against_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 6, size=(40, 2 + seed % 2)).astype(float)
    found = pareto_front(points)
    for point, is_on in zip(points.tolist(), found, strict=True):
        beaten = any(
            all(b >= a for a, b in zip(point, other, strict=True)) and other != point
            for other in points.tolist()
        )
        assert is_on == (not beaten)


@pytest.mark.parametrize("seed", range(2))
def test_the_order_against_brute_force(recipe: Recipe, seed: int) -> None:
    trials = made(recipe, 60, seed)
    order = ranked(trials)
    assert {t["number"] for t in order} == {
        t["number"] for t in trials if t["status"] == "converged"
    }

    def product(trial: dict[str, Any]) -> float:
        return trial["inradius_mm"] * trial["margin_deg"]

    for i, first in enumerate(order):
        for second in order[i + 1 :]:
            assert product(first) >= product(second)
            if product(first) == product(second):
                a, b = first["max_abs_error"], second["max_abs_error"]
                assert a < b or (a == b and first["number"] < second["number"])
            # Nothing comes after what it dominates.
            assert not (
                second["inradius_mm"] > first["inradius_mm"]
                and second["margin_deg"] > first["margin_deg"]
            )
    board = leaders(trials)
    assert board[:10] == order[:10]
    assert len(board) <= 13
    solved = [t for t in trials if t["status"] == "converged"]
    assert max(t["inradius_mm"] for t in board) == max(t["inradius_mm"] for t in solved)
    assert max(t["margin_deg"] for t in board) == max(t["margin_deg"] for t in solved)
    assert min(t["max_abs_error"] for t in board) == min(t["max_abs_error"] for t in solved)


class Sources(HTMLParser):
    """What a page refers to, and its cells."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.found += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("img", "meta", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_files(tmp_path: Path, recipe: Recipe) -> None:
    trials = made(recipe, 30)
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
    assert table["converged"] == len(ranked(trials))
    assert [entry["number"] for entry in board if entry["on_front"]] == [
        number for number in numbers if number in table["front"]
    ]
    with (folder / "leaderboard.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["number"]) for row in rows] == numbers
    assert [float(row["margin_deg"]) for row in rows] == [entry["margin_deg"] for entry in board]
    assert [int(row["seed"]) for row in rows] == [3 + number for number in numbers]

    page = Sources()
    text = (folder / "leaderboard.html").read_text()
    page.feed(text)
    assert page.open == []
    assert len(page.found) == len(board) + 1
    assert all(source.startswith("data:image/png;base64,") for source in page.found)
    assert "http:" not in text
    assert "https:" not in text
    assert not {"script", "link", "iframe"} & set(page.tags)
    assert all(entry["recipe_file"] in page.text for entry in board)
    assert f"{table['converged']} of 30 trials converged" in page.text

    for entry in board:
        again = read_recipe(folder / entry["recipe_file"])
        assert again.seed == 3 + entry["number"]
        assert again.name == f"four_trial_{entry['number']}"
    assert (folder / "best.yaml").read_text() == (folder / board[0]["recipe_file"]).read_text()

    # A later leaderboard leaves nothing of this one.
    later = write_results(folder, recipe, [{**trial, "status": "no_progress"} for trial in trials])
    assert later == []
    assert not list(folder.glob("trial_*.yaml"))
    assert not (folder / "best.yaml").exists()
    assert "there is no die to show" in (folder / "leaderboard.html").read_text()


@pytest.mark.parametrize(
    ("entries", "assigned"),
    [
        ({"target": {"binomial": 2}, "method": {"paper": {}}}, True),
        ({"target": {"fair": 3}, "method": {"paper": {}}}, False),
        ({"target": {"binomial": 2}, "symmetry": "C2v", "method": {"exact": {}}}, False),
    ],
)
def test_the_assignment_is_told_where_it_was_varied(
    tmp_path: Path, entries: dict[str, Any], assigned: bool
) -> None:
    recipe = checked_recipe({"name": "die", "start": {"prism": {"sides": 3}}, **entries})
    trials, rng = made(recipe, 6), np.random.default_rng(0)
    for trial in trials:
        values = {name: rng.uniform(e.low, e.high) for name, e in search_space(recipe).items()}
        trial["recipe"] = varied_recipe(recipe, trial["number"], values).resolved()
    board = write_results(tmp_path, recipe, trials)
    assert board
    for entry in board:
        assert ("assignment" in entry["varied"]) == assigned


def test_the_recipe_as_given_is_marked(tmp_path: Path, recipe: Recipe) -> None:
    trials = [{**trial, "status": "converged"} for trial in made(recipe, 4, 3)]
    assert all(trial["inradius_mm"] for trial in trials)
    write_results(tmp_path, recipe, trials)
    text = (tmp_path / "leaderboard.html").read_text()
    assert text.count("<br>as given<br>") == 1
    assert "trial_0.yaml<br>as given<br>seed 3</td>" in text
    write_results(tmp_path, recipe, trials[1:])
    assert "<br>as given<br>" not in (tmp_path / "leaderboard.html").read_text()


def test_best_is_what_was_found(tmp_path: Path, recipe: Recipe) -> None:
    """To the last bit, through the file."""
    result = run_trial(recipe.resolved())
    write_results(tmp_path, recipe, [{"number": 0, "recipe": recipe.resolved(), **result}])
    again = run_trial(read_recipe(tmp_path / "best.yaml").resolved())
    assert again["vertices"] == result["vertices"]
    assert again["margin_deg"] == result["margin_deg"]


@pytest.mark.parametrize("seed", range(2))
def test_a_lying_die_is_seen_whole(seed: int) -> None:
    """White on all borders, and in the middle."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3)) * [1.0, 0.3, 3.0]
    poses = rest_poses(points)
    data = lying_die_png(points, poses.normals[0])
    pixels = np.asarray(Image.open(BytesIO(data))).astype(int)
    dark = (pixels < 250).any(-1)
    assert dark.any()
    assert not dark[[0, -1]].any()
    assert not dark[:, [0, -1]].any()
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    for found in (rows, columns):
        assert abs((found[0] + found[-1]) / 2.0 - (len(dark) - 1) / 2.0) <= 1.5


def test_the_picture_tells_kinds_apart(recipe: Recipe) -> None:
    trials = made(recipe, 60)
    solved = ranked(trials)
    values = np.array([[trial["inradius_mm"], trial["margin_deg"]] for trial in solved])
    front = [t["number"] for t, on in zip(solved, pareto_front(values), strict=True) if on]
    named = [trial["number"] for trial in solved[:10]]
    sheet = pareto_chart(trials, front, named)
    (axes,) = sheet.figure.axes
    steps, *groups = axes.lines
    kinds = [trial["status"] for trial in trials]
    missed, converged, best = (len(group.get_xdata()) for group in groups[:3])
    assert missed == kinds.count("no_progress")
    assert best == len(front)
    assert converged + best == kinds.count("converged")
    assert groups[-1].get_label() == f"nothing to measure ({kinds.count('no_die')})"
    # The steps bound what the dice reach: none lies beyond, and the front lies on them.
    x, y = np.asarray(steps.get_xydata()).T
    for radius, margin in values:
        allowed = y[np.searchsorted(x, radius)] if radius <= x[-1] else -np.inf
        assert margin <= allowed
    assert axes.get_xlabel().endswith("(mm)")
    assert axes.get_ylabel().endswith("(°)")
    assert axes.texts[0].get_text() == str(solved[0]["number"])
    assert is_whole(sheet)
