"""Lengths of pages, install commands, and tables of shipped recipes, which keep their tolerances.
`test_recipes` tests the recipes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from common.paths import PAGES, commands

from benchmarks.frame import BENCHES, RECORDED
from dicedesign.recipe.reading import read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.tolerances import FILE_PROBABILITIES

MOST_LINES = {"README": 150, "CHANGELOG": 1000, "numbers": 1000, "recipes": 1000}
"""Maximum number of lines of pages; 250 of others."""


def shipped_recipes(repository: Path) -> list[Recipe]:
    return [read_recipe(path) for path in sorted((repository / "recipes").glob("*.yaml"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pages_are_short(page: Path) -> None:
    assert len(page.read_text().splitlines()) <= MOST_LINES.get(page.stem, 250)


def test_two_commands_install(repository: Path) -> None:
    install = [line for line in commands(repository / "README.md") if "venv" in line]
    assert len(install) == 2
    assert all(line.startswith("python3 -m venv .venv && ") for line in install)
    assert "dicedesign run" in install[0]
    assert "[test]" in install[1]


def test_every_bench_is_among_the_numbers(repository: Path) -> None:
    # The check of a change runs these lines.
    lines = commands(repository / "docs" / "numbers.md")
    benches = [line.split()[3] for line in lines if line.startswith("python -m benchmarks ")]
    assert set(benches) == set(BENCHES)


def recorded(table: str) -> dict[str, dict[str, str]]:
    """Rows of a recorded table by the name of the recipe."""
    found = json.loads(RECORDED.read_text(encoding="utf-8"))[table]
    rows = [dict(zip(found["titles"], row, strict=True)) for row in found["rows"]]
    return {row["recipe"]: row for row in rows}


def test_every_convex_recipe_is_recorded_within_its_tolerance(repository: Path) -> None:
    table = recorded("exact recipes")
    for recipe in shipped_recipes(repository):
        if recipe.method.concave is None and not recipe.method.is_thrown:
            row, target = table[recipe.name], recipe.target.target()
            assert row["status"] == "converged"
            assert int(row["outcomes"]) == len(target.labels)
            assert int(row["rests"]) == len(target.face_labels)
            assert float(row["as designed"]) <= recipe.method.tolerance
            most = max(recipe.method.tolerance, FILE_PROBABILITIES)
            assert float(row["in its file"]) <= most


def test_every_concave_recipe_is_recorded_within_its_tolerance(repository: Path) -> None:
    table = recorded("exact concave recipes")
    for recipe in shipped_recipes(repository):
        if recipe.method.concave is not None:
            row = table[recipe.name]
            assert row["status"] == "converged"
            assert max(float(row["max |p - q|"]), float(row["elsewhere"])) <= 5e-3
            assert float(row["displacement"].rstrip("%")) <= 5.0


def test_every_recipe_for_a_table_is_recorded_within_its_limit(repository: Path) -> None:
    found = json.loads(RECORDED.read_text(encoding="utf-8"))["thrown dice"]
    rows = [dict(zip(found["titles"], row, strict=True)) for row in found["rows"]]
    thrown = {row["recipe"]: row for row in rows if row["design"] == "own"}
    for recipe in shipped_recipes(repository):
        if recipe.method.is_thrown:
            exact, row = recipe.method.exact, thrown[recipe.name]
            assert exact is not None
            assert exact.refine is not None
            # The lower end of the interval: other throws than those that chose the die.
            assert float(row["from"]) <= exact.refine.within
