"""Finished dice that are made once a session, shared by all workers, and only read by tests."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

SharedFolder = Callable[[str, Callable[[Path], object]], Path]
"""Function of a name and a function that fills a new folder; returns the folder."""


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> SharedFolder:
    """Make a folder once a session, whichever worker comes first; the others wait for it.

    Tests must not change what is in it.
    """
    from filelock import FileLock

    base = tmp_path_factory.getbasetemp()
    root = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "shared"

    def get(name: str, make: Callable[[Path], object]) -> Path:
        root.mkdir(exist_ok=True)
        folder, done = root / name, root / f"{name}.done"
        with FileLock(root / f"{name}.lock"):
            if not done.exists():
                # A failed attempt may have left a part of it.
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                make(folder)
                done.touch()
        return folder

    return get


def run_recipe(recipe: Path | dict[str, Any], out: Path) -> None:
    """Run a recipe that converges, without a clock."""
    from dicedesign.recipe.pipeline import run
    from dicedesign.recipe.reading import parse_recipe, read_recipe

    if isinstance(recipe, Path):
        given = read_recipe(recipe, ["clock=false"])
    else:
        given = parse_recipe({**recipe, "clock": False})
    result = run(given, out)
    assert result.converged, result.message


@pytest.fixture(scope="session")
def convex_die(shared_folder: SharedFolder, repository: Path) -> Path:
    """Results folder of the README's first command: a die with labels that rolls 2d6."""
    recipe = repository / "recipes" / "2d6_hendecahedron.yaml"
    return shared_folder("2d6_hendecahedron", lambda out: run_recipe(recipe, out))


@pytest.fixture(scope="session")
def table_die(shared_folder: SharedFolder) -> Path:
    """Results folder of a die with labels for a table, with rounds of throws."""
    refine = {"drops": 500, "rounds": 2, "verdict": 1000, "within": 0.1}
    recipe = {
        "name": "loaded_d4",
        "target": {"probabilities": [0.1, 0.2, 0.3, 0.4]},
        "method": {"exact": {"probabilities": "thrown", "starts": 4, "refine": refine}},
    }
    return shared_folder("loaded_d4_table", lambda out: run_recipe(recipe, out))


def bumpy_recipe(mesh: Path, **options: Any) -> dict[str, Any]:
    """Recipe of a die with two outcomes from a mesh of 42 points. options: of the method."""
    from common.bodies import write_mesh
    from common.bumpy import bumpy_sphere

    surface = bumpy_sphere(1)
    write_mesh(mesh, surface.points, surface.triangles)
    return {
        "name": "bumpy",
        "target": {"probabilities": [0.6, 0.4]},
        "start": {"mesh": {"path": str(mesh)}},
        "method": {"concave": {"tolerance": 0.02, "attempts": 3, "displacement": 0.2, **options}},
        "size_mm": 40,
    }


@pytest.fixture(scope="session")
def concave_die(shared_folder: SharedFolder) -> Path:
    """Results folder of a concave die with labels, of 42 points."""

    def make(out: Path) -> None:
        run_recipe({**bumpy_recipe(out.with_suffix(".obj")), "engrave": True}, out)

    return shared_folder("bumpy", make)


@pytest.fixture(scope="session")
def hollow_die(shared_folder: SharedFolder) -> Path:
    """Results folder of a hollow concave die with labels, without figures."""

    def make(out: Path) -> None:
        recipe = bumpy_recipe(out.with_suffix(".obj"), hollow={"wall_mm": 1.5}, attempts=1)
        # Larger dice are less sensitive to errors of printers, which the search judges too.
        entries = {"size_mm": 60, "engrave": {"depth_mm": 0.4}, "figures": False}
        run_recipe({**recipe, **entries}, out)

    return shared_folder("hollow", make)
