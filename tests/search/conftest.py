"""What the tests of searches share."""

from __future__ import annotations

from pathlib import Path

import pytest

from dicedesign.recipe import Recipe
from dicedesign.recipe_file import read_recipe


@pytest.fixture
def recipe_path(tmp_path: Path) -> Path:
    """A file with the recipe of a fair die of five faces, found in a moment."""
    path = tmp_path / "five.yaml"
    path.write_text(
        "name: five\nseed: 3\ntarget: {fair: 5}\nstart: {search: {}}\nmethod: {exact: {}}\n"
    )
    return path


@pytest.fixture
def recipe(recipe_path: Path) -> Recipe:
    """The same, read."""
    return read_recipe(recipe_path)
