"""Loops over tasks, their order and their number, and lost workers."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from concurrent.futures import wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import Any

import pytest
from common.inline_executor import Inline, Late, Lossy

from dicedesign.cli.options import workers_of
from dicedesign.cli.shared_options import WithWorkers
from dicedesign.errors import DiceError
from dicedesign.runtime import workers
from dicedesign.runtime.workers import (
    in_order,
    is_lost_worker,
    iterate_completed,
    local_workers,
    run_in_batches,
)


def test_as_many_run_at_a_time_as_permitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks end in the wrong order, and only when nothing else happens."""
    late, running = Late(), []

    def wait_for_one(futures: Any, **options: Any) -> Any:
        running.append(len(late.waiting))
        late.end_one()
        return wait(futures, **options)

    monkeypatch.setattr(workers, "wait", wait_for_one)
    ended = iterate_completed(deque(range(8)), lambda task: late.submit(pow, task, 2), 6)
    squares = {task: future.result() for task, future in ended}
    assert squares == {n: n**2 for n in range(8)}
    assert list(squares) != list(range(8))
    assert running == [6, 6, 6, 5, 4, 3, 2, 1]


def test_small_items_share_tasks_that_suffice_for_all_workers() -> None:
    sizes = [100] * 2000 + [600_000, 300_000, 200_000, 5_000_000, 100]
    lossy, done = Lossy(lambda *_: False), list[int]()
    submit = partial(lossy.submit, list)
    assert run_in_batches(sizes, submit, 2, done.extend, size_of=int) == []
    assert sorted(done) == sorted(sizes)
    assert [len(task) for (task,) in lossy.submitted] == [64] * 31 + [18, 1, 1, 1]
    for jobs, expected in ((1, [2] * 8), (2, [1] * 16), (20, [1] * 16)):
        lossy = Lossy(lambda *_: False)
        run_in_batches(range(16), partial(lossy.submit, list), jobs, done.extend)
        assert [len(task) for (task,) in lossy.submitted] == expected


def test_items_of_lost_workers_are_retried_alone() -> None:
    lossy, done = Lossy(lambda count, task: 42 in task), list[int]()
    assert run_in_batches(range(100), partial(lossy.submit, list), 1, done.extend) == [42]
    assert sorted(done) == [number for number in range(100) if number != 42]
    assert sum(task == [42] for (task,) in lossy.submitted) == 3
    with pytest.raises(ZeroDivisionError):
        run_in_batches([1], lambda task: Inline().submit(lambda: 1 // 0), 1, done.extend)


def test_results_are_in_order_in_spite_of_lost_workers() -> None:
    tasks = [partial(pow, number, 2) for number in range(5)]
    lossy = Lossy(lambda count: count in (2, 4, 6))
    assert list(in_order(tasks, lossy)) == [0, 1, 4, 9, 16]
    assert len(lossy.submitted) == 8
    # The tasks of a pool that broke run again at the same time.
    lossy = Lossy(lambda count: count <= 5)
    results = in_order(tasks, lossy)
    assert next(results) == 0
    assert len(lossy.submitted) == 10
    assert list(results) == [1, 4, 9, 16]
    with pytest.raises(DiceError, match=r"expected some that stay, but 5 were lost while one"):
        list(in_order(tasks, Lossy(lambda count: count > 3)))


def test_an_error_of_a_task_is_no_lost_worker() -> None:
    assert is_lost_worker(BrokenProcessPool())
    assert not is_lost_worker(RuntimeError())
    with pytest.raises(ZeroDivisionError):
        list(in_order([lambda: 1 // 0], Inline()))


def test_a_local_worker_that_dies_is_replaced() -> None:
    others = set(multiprocessing.active_children())
    with local_workers(1) as workers:
        lost = workers.submit(os.kill, workers.submit(os.getpid).result(), signal.SIGKILL)
        assert is_lost_worker(lost.exception() or RuntimeError())
        assert workers.submit(pow, 3, 2).result() == 9
    assert set(multiprocessing.active_children()) == others


def test_no_more_processes_than_pieces_of_work(capsys: pytest.CaptureFixture[str]) -> None:
    with workers_of(WithWorkers(jobs=64), "files", 12, 10) as workers:
        assert workers.jobs == 2
        assert workers.executor.submit(pow, 3, 2).result() == 9
    assert capsys.readouterr().out == ""
