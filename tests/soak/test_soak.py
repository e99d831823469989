"""Endurance tests: many meshes and random recipes, with killed processes.

The inputs depend only on the seed.

    pytest tests/soak -m soak -n 0

`SOAK_MESHES`, `SOAK_RUNS`, `SOAK_FILES`, `SOAK_KILLS` and `SOAK_STEPS` are the numbers of meshes,
recipes, damaged files, kills and steps of state machines; `SOAK_SEED` is the seed, and `SOAK_FIRST`
the number of the first run.
"""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import RuleBasedStateMachine, run_state_machine_as_test

from tests.soak import damaged
from tests.soak.frame import all_faults
from tests.soak.kills import KILLS, try_kills
from tests.soak.machines import (
    PageBodies,
    ResultsFolder,
    SweptFolder,
    prepare_body,
    prepare_sweep,
)
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


STEPS_PER_EXAMPLE = 50
"""Most steps of one example of a state machine."""

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


def test_damaged_files(tmp_path: Path) -> None:
    damaged.make_originals(tmp_path)
    cases = range(-(-setting("FILES", 20_000) // damaged.PER_CASE))
    assert all_faults(damaged.try_files, cases, tmp_path, SEED) == []


def test_kills(tmp_path: Path) -> None:
    cases = range(-(-setting("KILLS", 1_000) // KILLS))
    assert all_faults(try_kills, cases, tmp_path, SEED) == []


@pytest.mark.parametrize(
    ("machine", "part"), [(ResultsFolder, 0.5), (PageBodies, 0.45), (SweptFolder, 0.05)]
)
def test_state_machines(machine: type[RuleBasedStateMachine], part: float, tmp_path: Path) -> None:
    """A sweep has fewer steps, as each takes long."""
    steps = round(part * setting("STEPS", 20_000))
    SweptFolder.source = prepare_sweep(tmp_path) if machine is SweptFolder else tmp_path
    PageBodies.source = prepare_body(tmp_path)
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=max(steps // STEPS_PER_EXAMPLE, 1),
            stateful_step_count=STEPS_PER_EXAMPLE,
            deadline=None,
            derandomize=True,
            database=None,
            phases=[Phase.generate, Phase.shrink],
            suppress_health_check=list(HealthCheck),
        ),
    )
