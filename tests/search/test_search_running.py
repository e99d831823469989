"""Trials side by side, workers that are lost, and interrupts."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest
from common.inline_executor import Inline

from dicedesign.cli.main import main
from dicedesign.errors import DiceError
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.runtime import executors
from dicedesign.runtime.executors import is_lost_worker, local_workers
from dicedesign.search.study import JOURNAL, open_study
from dicedesign.search.trial_scheduler import run_search


class Lossy(Inline):
    """Loses the worker of each submission for which a test says so; counts all."""

    def __init__(self, error: Callable[[int], Exception | None]) -> None:
        self.error = error
        self.submitted = 0

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.submitted += 1
        error = self.error(self.submitted)
        if error is None:
            return super().submit(function, *args, **kwargs)
        future: Future[Any] = Future()
        future.set_exception(error)
        return future


@pytest.mark.usefixtures("made_up")
def test_a_trial_whose_worker_is_lost_runs_again(tmp_path: Path, recipe: Recipe) -> None:
    lossy = Lossy(lambda count: BrokenProcessPool() if count in (2, 3, 5) else None)
    with open_study(tmp_path / "a", recipe) as study:
        run_search(study, 4, lossy, 1)
        found = study.finished()
    assert lossy.submitted == 7
    with open_study(tmp_path / "b", recipe) as study:
        run_search(study, 4, Inline(), 1)
        expected = study.finished()
    assert found == expected


@pytest.mark.usefixtures("made_up")
def test_a_trial_that_loses_every_worker_ends_the_search(tmp_path: Path, recipe: Recipe) -> None:
    lossy = Lossy(lambda count: BrokenProcessPool() if count > 2 else None)
    message = "trial 2: expected workers .* it was running when workers were lost 5 times"
    with open_study(tmp_path, recipe) as study, pytest.raises(DiceError, match=message):
        run_search(study, 4, lossy, 1)
    with open_study(tmp_path, recipe) as study:
        assert [trial["number"] for trial in study.finished()] == [0, 1]
        run_search(study, 4, Inline(), 1)
        assert [trial["number"] for trial in study.finished()] == [0, 1, 3, 4]


@pytest.mark.usefixtures("made_up")
def test_an_error_of_a_trial_is_none_of_the_worker(tmp_path: Path, recipe: Recipe) -> None:
    assert not is_lost_worker(RuntimeError())
    lossy = Lossy(lambda count: ZeroDivisionError("a bug") if count == 2 else None)
    with open_study(tmp_path, recipe) as study:
        with pytest.raises(ZeroDivisionError, match="a bug"):
            run_search(study, 4, lossy, 1)
        assert len(study.finished()) == 1


@pytest.mark.usefixtures("made_up")
def test_as_many_run_at_a_time_as_jobs(tmp_path: Path, recipe: Recipe) -> None:
    """Futures that end only once the next is waited for, in the wrong order."""
    waiting: list[tuple[Future[Any], Any]] = []
    most = 0

    class Late(Inline):
        def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            nonlocal most
            future: Future[Any] = Future()
            waiting.append((future, function(*args, **kwargs)))
            most = max(most, len(waiting))
            if len(waiting) == 3:
                finish()
            return future

    def finish() -> None:
        future, result = waiting.pop()
        future.set_result(result)

    with open_study(tmp_path, recipe) as study:
        run_search(study, 5, Late(), 3, on_trial=lambda _: finish() if waiting else None)
        assert most == 3
        assert [trial["number"] for trial in study.finished()] == [0, 1, 2, 3, 4]


@pytest.mark.usefixtures("made_up")
def test_where_nothing_ends_the_caller_is_told(
    tmp_path: Path, recipe: Recipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executors, "QUIET", 0.01)
    waiting: list[tuple[Future[Any], Any]] = []
    told = 0

    class Late(Inline):
        def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            waiting.append((Future(), function(*args, **kwargs)))
            return waiting[-1][0]

    def on_quiet() -> None:
        nonlocal told
        told += 1
        if told % 3 == 0:
            future, result = waiting.pop()
            future.set_result(result)

    with open_study(tmp_path, recipe) as study:
        run_search(study, 2, Late(), 1, on_quiet=on_quiet)
        assert len(study.finished()) == 2
    assert told == 6


@pytest.mark.usefixtures("made_up")
def test_a_local_worker_that_is_killed_is_replaced(tmp_path: Path, recipe: Recipe) -> None:
    killed = []

    def kill(_: dict[str, Any]) -> None:
        if not killed:
            (worker,) = set(multiprocessing.active_children()) - others
            worker.kill()
            killed.append(worker)

    others = set(multiprocessing.active_children())
    with open_study(tmp_path, recipe) as study, local_workers(1) as executor:
        run_search(study, 3, executor, 1, on_trial=kill)
        assert [trial["number"] for trial in study.finished()] == [0, 1, 2]
    assert killed[0].exitcode == -signal.SIGKILL
    assert set(multiprocessing.active_children()) == others


def begun(command: list[str], folder: Path, trials: int) -> subprocess.Popen[str]:
    """A search that has so many trials."""
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, process_group=0)
    deadline = time.monotonic() + 60.0
    while journal_size(folder) < trials:
        assert time.monotonic() < deadline
        assert process.poll() is None, process.stderr and process.stderr.read()
        time.sleep(0.05)
    return process


def journal_size(folder: Path) -> int:
    journal = folder / JOURNAL
    return journal.read_bytes().count(b'"values":[') if journal.exists() else 0


def members(group: int) -> list[int]:
    """Processes of a group that still run."""
    listed = subprocess.run(
        ["ps", "-e", "-o", "pgid=,pid=,stat="], capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in listed.stdout.splitlines()]
    return [int(pid) for pgid, pid, state in rows if int(pgid) == group and state[0] != "Z"]


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_search_can_go_on(
    tmp_path: Path, recipe_path: Path, capsys: pytest.CaptureFixture[str], end: signal.Signals
) -> None:
    """As by Ctrl-C, which every process of the terminal's group gets, or by force."""
    folder = tmp_path / "out"
    search = ["search", str(recipe_path), "--jobs", "1", "--out", str(folder), "--trials"]
    process = begun([sys.executable, "-m", "dicedesign", *search, "100000"], folder, 2)
    if end is signal.SIGINT:
        os.killpg(process.pid, end)
    else:
        process.kill()
    _, said = process.communicate(timeout=30.0)
    if end is signal.SIGINT:
        assert process.returncode == 130
        assert said == "dicedesign: interrupted; nothing half-written was left\n"
    deadline = time.monotonic() + 30.0
    while members(process.pid):
        assert time.monotonic() < deadline, "workers live on"
        time.sleep(0.05)
    assert not list(folder.glob("*.part"))

    found = journal_size(folder)
    assert main([*search, "1"]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith(f"four: {found} of {found} trials converged\n")
    assert captured.err == f"note: {found} trials were already in {folder}\n"
