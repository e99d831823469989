"""Endurance tests: many meshes and random recipes, with killed processes.

The inputs depend only on the seed.

    pytest tests/soak -m soak -n 0

`SOAK_MESHES` and `SOAK_RUNS` are the numbers of cases, `SOAK_SEED` is the seed, and `SOAK_FIRST` is
the number of the first run.
"""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path

import pytest

from tests.soak.frame import all_faults
from tests.soak.meshes import batch_faults, make_meshes, run_batches
from tests.soak.runs import try_recipe

pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(
        "forkserver" not in multiprocessing.get_all_start_methods(), reason="no signals and forks"
    ),
]


def setting(name: str, default: int) -> int:
    return int(os.environ.get(f"SOAK_{name}", default))


SEED, FIRST = setting("SEED", 0), setting("FIRST", 0)


def test_meshes_of_a_folder(tmp_path: Path) -> None:
    count = setting("MESHES", 10_000)
    meshes, table = tmp_path / "meshes", tmp_path / "table" / "rests.csv"
    meshes.mkdir()
    table.parent.mkdir()
    answers = make_meshes(meshes, count, SEED)
    assert [*run_batches(meshes, table, count, SEED), *batch_faults(table, answers)] == []


def test_runs_of_recipes(tmp_path: Path) -> None:
    numbers = range(FIRST, FIRST + setting("RUNS", 300))
    assert all_faults(try_recipe, numbers, tmp_path, SEED) == []
