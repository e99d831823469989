"""A soak of the program as people and scripts meet it: very many meshes, random recipes and damaged
files, with processes killed on the way. What is made depends on the seed alone.

    pytest tests/soak -m soak -n 0

runs it by hand; `SOAK_MESHES`, `SOAK_RUNS` and `SOAK_FILES` say how much of it, `SOAK_SEED` what,
and `SOAK_FIRST` is the number of the first run and file.
"""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path

import pytest

from tests.soak.files import make_samples, try_damaged
from tests.soak.frame import all_faults
from tests.soak.meshes import batch_faults, make_meshes, run_batches
from tests.soak.runs import try_recipe

pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(
        "forkserver" not in multiprocessing.get_all_start_methods(), reason="no signals and forks"
    ),
]


def amount(name: str, default: int) -> int:
    return int(os.environ.get(f"SOAK_{name}", default))


SEED, FIRST = amount("SEED", 0), amount("FIRST", 0)


def test_meshes_of_a_folder(tmp_path: Path) -> None:
    count = amount("MESHES", 10_000)
    meshes, table = tmp_path / "meshes", tmp_path / "table" / "rests.csv"
    meshes.mkdir()
    table.parent.mkdir()
    answers = make_meshes(meshes, count, SEED)
    assert [*run_batches(meshes, table, count, SEED), *batch_faults(table, answers)] == []


def test_runs_of_recipes(tmp_path: Path) -> None:
    numbers = range(FIRST, FIRST + amount("RUNS", 300))
    assert all_faults(try_recipe, numbers, tmp_path, SEED) == []


def test_damaged_files(tmp_path: Path) -> None:
    make_samples(tmp_path)
    numbers = range(FIRST, FIRST + amount("FILES", 5_000))
    assert all_faults(try_damaged, numbers, tmp_path, SEED) == []
