"""Tasks of a batch: their sizes, how many run at a time, and workers that are lost."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest
from common.inline_executor import Inline

from dicedesign.batch import file_batches as running
from dicedesign.batch.file_batches import run_batch
from dicedesign.batch.rows import Entry, Stamp, broken_entry
from dicedesign.runtime import executors
from dicedesign.runtime.executors import local_workers


def made_up(_: str, stamps: dict[str, Stamp], *__: Any) -> dict[str, Entry]:
    """Entries without an analysis."""
    return {file: Entry(stamp, f"{file}\n", 1) for file, stamp in stamps.items()}


def deadly(folder: str, stamps: dict[str, Stamp], *_: Any) -> dict[str, Entry]:
    """The same, but one file kills the process."""
    if "7.stl" in stamps:
        os.kill(os.getpid(), signal.SIGKILL)
    return made_up(folder, stamps)


class Counting(Inline):
    """Remembers the files of each task, and loses the worker of those for which a test says so."""

    def __init__(self, lost: Callable[[int, list[str]], bool] = lambda count, files: False) -> None:
        self.lost = lost
        self.tasks: list[list[str]] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.tasks.append(list(args[1]))
        if self.lost(len(self.tasks), self.tasks[-1]):
            future: Future[Any] = Future()
            future.set_exception(BrokenProcessPool())
            return future
        return super().submit(function, *args, **kwargs)


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
    executor = Counting()
    assert run(stamps, executor) == made_up("", stamps)
    assert [len(task) for task in executor.tasks] == [64] * 31 + [18, 1, 1, 1]
    assert [file for task in executor.tasks for file in task] == list(stamps)


def test_few_files_are_spread_over_all_workers() -> None:
    for jobs, expected in ((1, [2] * 8), (2, [1] * 16), (20, [1] * 16)):
        executor = Counting()
        run({f"{i}.stl": Stamp(100, 1) for i in range(16)}, executor, jobs)
        assert [len(task) for task in executor.tasks] == expected


def test_two_tasks_for_each_job_are_on_their_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Futures that end only once no more are added, in the wrong order."""
    monkeypatch.setattr(executors, "QUIET", 0.01)
    waiting: list[tuple[Future[Any], Any]] = []
    seen: list[int] = []

    class Late(Inline):
        def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            waiting.append((Future(), function(*args, **kwargs)))
            return waiting[-1][0]

    def on_quiet() -> None:
        seen.append(len(waiting))
        future, result = waiting.pop()
        future.set_result(result)

    stamps = {f"{i}.stl": Stamp(10**6, 1) for i in range(8)}
    entries: dict[str, Entry] = {}
    run_batch("", stamps, Late(), 3, on_entries=entries.update, on_quiet=on_quiet)
    assert entries == made_up("", stamps)
    assert seen == [6, 6, 6, 5, 4, 3, 2, 1]


def test_files_whose_worker_is_lost_run_again_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "FEWEST_TASKS_PER_JOB", 1)
    stamps = {f"{i}.stl": Stamp(400_000, 1) for i in range(6)}
    executor = Counting(lambda count, files: count in (1, 3))
    assert run(stamps, executor) == made_up("", stamps)
    assert sorted(executor.tasks[3:]) == [["0.stl"], ["1.stl"], ["4.stl"], ["5.stl"]]


def test_only_the_file_that_takes_workers_down_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(running, "FEWEST_TASKS_PER_JOB", 1)
    stamps = {f"{i}.stl": Stamp(100, 1) for i in range(6)}
    executor = Counting(lambda count, files: "4.stl" in files)
    entries = run(stamps, executor)
    reason = (
        "4.stl: expected workers that stay, but all 3 that analysed it were lost; see whether "
        "memory suffices"
    )
    assert entries.pop("4.stl") == broken_entry("4.stl", stamps.pop("4.stl"), reason)
    assert entries == made_up("", stamps)
    assert executor.tasks.count(["4.stl"]) == 3


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
