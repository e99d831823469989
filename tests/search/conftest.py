"""Fixtures for tests of searches."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from common.made_up_trial import made_up_trial

from dicedesign.recipe.reading import read_recipe
from dicedesign.recipe.recipe import Recipe


@pytest.fixture(autouse=True)
def unsynced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip waiting for the disk; no test is about power failures."""
    monkeypatch.setattr(os, "fsync", lambda file: None)


@pytest.fixture
def recipe_path(tmp_path: Path) -> Path:
    """Recipe file of a fair d4, which is designed quickly."""
    path = tmp_path / "four.yaml"
    path.write_text(
        "name: four\nseed: 3\ntarget: {fair: 4}\nmethod: {exact: {prefer: {}}}\nengrave: false\n"
    )
    return path


@pytest.fixture
def recipe(recipe_path: Path) -> Recipe:
    """Recipe of a fair d4."""
    return read_recipe(recipe_path)


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace trials by instant results."""
    monkeypatch.setattr("dicedesign.search.trials.run_trial", made_up_trial)
