"""Recipe of a die that is designed quickly."""

from __future__ import annotations

from pathlib import Path

import pytest

RECIPE = """
name: four
target: {fair: 4}
method: exact
engrave: false
print: false
figures: false
report: false
clock: false
"""


@pytest.fixture(scope="session")
def recipe_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recipe file of a fair d4."""
    path = tmp_path_factory.mktemp("recipe") / "four.yaml"
    path.write_text(RECIPE)
    return path
