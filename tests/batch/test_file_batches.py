"""Tasks of a batch: their sizes, how many run at a time, and workers that are lost."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest
from common.inline_executor import Inline, Lossy

from dicedesign.batch import file_batches as running
from dicedesign.batch.file_batches import run_batch
from dicedesign.batch.rows import Entry, Stamp, broken_entry
from dicedesign.runtime.workers import local_workers


def made_up(_: str, stamps: dict[str, Stamp], *__: Any) -> dict[str, Entry]:
    """Entries without an analysis."""
    return {file: Entry(stamp, f"{file}\n", 1) for file, stamp in stamps.items()}


def deadly(folder: str, stamps: dict[str, Stamp], *_: Any) -> dict[str, Entry]:
    """The same, but one file kills the process."""
    if "7.stl" in stamps:
        os.kill(os.getpid(), signal.SIGKILL)
    return made_up(folder, stamps)


def tasks_of(executor: Lossy) -> list[list[str]]:
    """The files of each task that was submitted."""
    return [list(stamps) for _, stamps, *_ in executor.submitted]


def run(stamps: dict[str, Stamp], executor: Any, jobs: int = 2) -> dict[str, Entry]:
    entries: dict[str, Entry] = {}
    run_batch("there", stamps, executor, jobs, on_entries=entries.update)
    return entries


@pytest.fixture(autouse=True)
def no_analysis(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "analyse_files", made_up)


def test_small_files_share_a_task() -> None:
    sizes = [100] * 2000 + [600_000, 300_000, 200_000, 5_000_000, 100]
    stamps = {f"{i:04d}.stl": Stamp(size, 1) for i, size in enumerate(sizes)}
    executor = Lossy(lambda *_: False)
    assert run(stamps, executor) == made_up("", stamps)
    assert [len(task) for task in tasks_of(executor)] == [64] * 31 + [18, 1, 1, 1]
    assert [file for task in tasks_of(executor) for file in task] == list(stamps)


def test_few_files_are_spread_over_all_workers() -> None:
    for jobs, expected in ((1, [2] * 8), (2, [1] * 16), (20, [1] * 16)):
        executor = Lossy(lambda *_: False)
        run({f"{i}.stl": Stamp(100, 1) for i in range(16)}, executor, jobs)
        assert [len(task) for task in tasks_of(executor)] == expected


def test_files_whose_worker_is_lost_run_again_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "FEWEST_TASKS_PER_JOB", 1)
    stamps = {f"{i}.stl": Stamp(400_000, 1) for i in range(6)}
    executor = Lossy(lambda count, *_: count in (1, 3))
    assert run(stamps, executor) == made_up("", stamps)
    assert sorted(tasks_of(executor)[3:]) == [["0.stl"], ["1.stl"], ["4.stl"], ["5.stl"]]


def test_only_the_file_that_takes_workers_down_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(running, "FEWEST_TASKS_PER_JOB", 1)
    stamps = {f"{i}.stl": Stamp(100, 1) for i in range(6)}
    executor = Lossy(lambda count, folder, files, *_: "4.stl" in files)
    entries = run(stamps, executor)
    reason = (
        "4.stl: expected workers that stay, but all 3 that analysed it were lost; see whether "
        "memory suffices"
    )
    assert entries.pop("4.stl") == broken_entry("4.stl", stamps.pop("4.stl"), reason)
    assert entries == made_up("", stamps)
    assert tasks_of(executor).count(["4.stl"]) == 3


def test_an_error_of_the_task_itself_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "analyse_files", lambda *_: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        run({"a.stl": Stamp(1, 1)}, Inline())


def test_a_process_that_dies_costs_one_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(running, "analyse_files", deadly)
    stamps = {f"{i}.stl": Stamp(200_000, 1) for i in range(12)}
    with local_workers(2) as executor:
        entries = run(stamps, executor)
    assert [file for file, entry in entries.items() if entry.rests == 0] == ["7.stl"]
    assert set(entries) == set(stamps)
