"""A soak of the program as people and scripts meet it: very many meshes, random recipes and damaged
files, with processes killed on the way. What is made depends on the seed alone.

    pytest tests/soak -m soak -n 0

runs it by hand; `SOAK_MESHES`, `SOAK_RUNS` and `SOAK_FILES` say how much of it, `SOAK_SEED` what,
and `SOAK_FIRST` is the number of the first run and file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import pytest

from tests.soak.batch import batch_faults, make_meshes, run_batches
from tests.soak.commands import Case, Fault, drive, require_signals
from tests.soak.files import Samples, file_cases
from tests.soak.runs import run_cases

pytestmark = pytest.mark.soak

SEED = int(os.environ.get("SOAK_SEED", "0"))

JOBS = 2

MOST_GROWTH = 0.1
"""Part by which the memory of a worker that counts as flat may grow."""


def amount(name: str, default: int) -> int:
    return int(os.environ.get(f"SOAK_{name}", default))


def numbers(name: str, default: int) -> range:
    first = amount("FIRST", 0)
    return range(first, first + amount(name, default))


@pytest.fixture(autouse=True)
def with_signals() -> None:
    require_signals()


def faults_of_all(cases: Iterable[Case], scratch: Path) -> list[tuple[int, Fault]]:
    scratch.mkdir()
    with closing(drive(cases, scratch, JOBS)) as tried:
        return [(one.number, fault) for one in tried for fault in one.faults]


def test_meshes_of_a_folder(tmp_path: Path) -> None:
    count = amount("MESHES", 10_000)
    meshes, table = tmp_path / "meshes", tmp_path / "table" / "rests.csv"
    meshes.mkdir()
    table.parent.mkdir()
    answers = make_meshes(meshes, count, SEED)
    batch = run_batches(meshes, table, JOBS, count, SEED, kill_seconds=20.0)
    assert [*batch.faults, *batch_faults(table, answers)] == []
    assert (batch.growth or 0.0) <= MOST_GROWTH


def test_runs_of_recipes(tmp_path: Path) -> None:
    cases = run_cases(tmp_path, numbers("RUNS", 300), SEED)
    assert faults_of_all(cases, tmp_path / "printed") == []


def test_damaged_files(tmp_path: Path) -> None:
    folder = tmp_path / "samples"
    folder.mkdir()
    cases = file_cases(Samples(folder), numbers("FILES", 5_000), SEED)
    assert faults_of_all(cases, tmp_path / "printed") == []
