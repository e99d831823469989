"""Lengths of pages, install commands, and tables of shipped recipes, which keep their tolerances.
`test_recipes` tests the recipes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from common.doc_pages import PAGES, commands

from benchmarks.frame import BENCHES
from dicedesign.recipe.reading import read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.tolerances import FILE_PROBABILITIES

MOST_LINES = {"README": 150, "CHANGELOG": 1000, "numbers": 1000, "recipes": 1000}
"""Maximum number of lines of pages; 250 of others."""


def rows(page: Path, pattern: str) -> list[tuple[str, ...]]:
    return re.findall(pattern, page.read_text(encoding="utf-8"), re.MULTILINE)


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


def test_every_recipe_is_in_the_table_within_its_tolerance(repository: Path) -> None:
    pattern = r"^\| `(\w+)` \| (\d+) \| (\d+) \+ (\d+) \| (\S+) \| (\S+) \|"
    table = rows(repository / "docs" / "numbers.md", pattern)
    recipes = [
        recipe
        for recipe in shipped_recipes(repository)
        if recipe.method.concave is None and not recipe.method.is_thrown
    ]
    assert [row[0] for row in table] == [recipe.name for recipe in recipes]
    for recipe, (_, outcomes, labeled, stray, designed, error) in zip(recipes, table, strict=True):
        assert int(outcomes) == int(labeled) == len(recipe.target.target().labels)
        assert int(stray) == 0
        assert float(designed) <= recipe.method.tolerance
        assert float(error) <= max(recipe.method.tolerance, FILE_PROBABILITIES)


def test_every_concave_recipe_is_in_its_table_within_its_tolerance(repository: Path) -> None:
    pattern = r"^\| `(\w+)` \| (\d+) \| (\S+e\S+) \| (\S+e\S+) \| (\S+) \|"
    table = rows(repository / "docs" / "concave.md", pattern)
    recipes = [
        recipe for recipe in shipped_recipes(repository) if recipe.method.concave is not None
    ]
    assert [row[0] for row in table] == [recipe.name for recipe in recipes]
    for recipe, (_, outcomes, error, elsewhere, displacement) in zip(recipes, table, strict=True):
        assert int(outcomes) == len(recipe.target.target().labels)
        assert max(float(error), float(elsewhere)) <= recipe.method.tolerance
        assert float(displacement) <= 5.0


def test_every_recipe_for_a_table_is_in_its_table_within_its_limit(
    repository: Path,
) -> None:
    pattern = r"^\| `(\w+)` \| `\w+` \| (0\.\d+) \| (0\.\d+) \|"
    table = rows(repository / "docs" / "tables.md", pattern)
    recipes = [recipe for recipe in shipped_recipes(repository) if recipe.method.is_thrown]
    assert [row[0] for row in table] == [recipe.name for recipe in recipes]
    for recipe, (_, deviation, perfect) in zip(recipes, table, strict=True):
        exact = recipe.method.exact
        assert exact is not None
        assert exact.refine is not None
        assert float(deviation) <= exact.refine.within
        assert 0.5 * float(perfect) < float(deviation)
