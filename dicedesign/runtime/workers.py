"""Local processes or a Dask cluster for many tasks, loops over tasks, and thread limits."""

from __future__ import annotations

import logging
import multiprocessing
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, TypeVar

from dicedesign.errors import DiceError, InputError, missing_extra
from dicedesign.runtime.interrupts import block_signals, hold_interrupts, obey_parent

if TYPE_CHECKING:
    from tqdm import tqdm


@contextmanager
def one_tensor_thread() -> Iterator[None]:
    """Limit torch to one thread: tensors here are too small for more, and processes often run in
    parallel, one per core."""
    torch = import_module("torch")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch and the BLAS of NumPy and SciPy to one thread, so that sums do not depend on the
    number of cores."""
    # Only long searches need it.
    from threadpoolctl import threadpool_limits

    with one_tensor_thread(), threadpool_limits(1):
        yield


PATIENCE = 30.0
"""Timeout of a cluster in seconds."""

PACKAGE = "dicedesign"
"""Package that the workers of a cluster need too, in this version."""

MOST_LOSSES = 5
"""Number of lost workers after which a task is abandoned."""

Task = TypeVar("Task")

Item = TypeVar("Item")

Result = TypeVar("Result")


class _LocalWorkers(Executor):
    """Process pool that restarts after a process dies, which fails all running tasks."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._others = set(multiprocessing.active_children())
        self._pool = self._start()

    def _start(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        # It starts the process that frees shared memory, which must not be interrupted.
        with block_signals():
            return ProcessPoolExecutor(self._jobs, context, _begin_worker)

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        # It may start a process, which must not be interrupted before it ignores interrupts.
        with block_signals():
            try:
                return self._pool.submit(function, *args, **kwargs)
            except BrokenExecutor:
                self._pool.shutdown(wait=True)
                self._pool = self._start()
                return self._pool.submit(function, *args, **kwargs)

    def terminate(self) -> None:
        """End all processes, also while tasks run."""
        for process in set(multiprocessing.active_children()) - self._others:
            process.terminate()
        self._pool.shutdown(cancel_futures=True)


def _begin_worker() -> None:
    """Ignore interrupts, and exit with the parent even if it is killed."""
    obey_parent()
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


@contextmanager
def local_workers(jobs: int) -> Iterator[Executor]:
    """Local process pool of `jobs` workers; lost workers are replaced."""
    workers = _LocalWorkers(jobs)
    try:
        yield workers
    finally:
        workers.terminate()


class _ClusterWorkers(Executor):
    """Executor of a Dask client that raises when the scheduler is gone."""

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address
        # With pure=False a resubmitted task runs again.
        self._workers: Executor = client.get_executor(pure=False)

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        while self._client.status == "connecting":
            time.sleep(0.1)
        if self._client.status != "running":
            raise DiceError(
                f"--scheduler {self._address}: expected a Dask scheduler until the end, but it is "
                "gone; repeat the command to resume"
            )
        return self._workers.submit(function, *args, **kwargs)


@contextmanager
def cluster_workers(address: str) -> Iterator[tuple[Executor, int]]:
    """Executor of a Dask cluster, and its number of threads. Workers may join later; without
    workers, tasks wait.

    address: scheduler, such as tcp://10.0.0.5:8786, or tls://10.0.0.5:8786 with certificates from
        the configuration of distributed.

    Raises
    ------
    InputError: distributed is not installed, its certificates are missing or broken, no scheduler
        or worker answers, or the workers lack this version of the package.
    DiceError: by `submit`, if the scheduler is gone.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise missing_extra("cluster", "--scheduler", error) from error
    # Errors report what it would log.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    client = None
    try:
        try:
            connect = partial(Client, address, timeout=PATIENCE, set_as_default=False)
            try:
                client = connect()
            except AssertionError:
                # Dask fails if the first messages of a busy scheduler arrive together.
                client = connect()
            client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            missing = "a Dask scheduler" if client is None else "at least one worker"
            raise InputError(
                f"--scheduler {address}: expected {missing} that answers within {PATIENCE:g} "
                f"seconds, got: {error}; start it with `dask {missing.split()[-1]}`, and see "
                "docs/researchers.md for the certificates of tls://"
            ) from error
        _check_versions(client, address)
        yield _ClusterWorkers(client, address), sum(client.nthreads().values())
    finally:
        if client is not None:
            # Abandon tasks that still run, and ignore a slow shutdown.
            with suppress(AssertionError):
                client.close(timeout=PATIENCE)


def _check_versions(client: Any, address: str) -> None:
    workers = client.get_versions(packages=[PACKAGE])["workers"].values()
    versions = {str(worker["packages"][PACKAGE]) for worker in workers}
    if versions != {version(PACKAGE)}:
        raise InputError(
            f"--scheduler {address}: expected workers with {PACKAGE} {version(PACKAGE)}, got "
            f"{', '.join(sorted(versions))}; install that version where they run"
        )


def is_lost_worker(error: BaseException) -> bool:
    """Whether a future failed because its worker was lost."""
    lost: tuple[type[BaseException], ...] = (BrokenExecutor, CancelledError)
    if "distributed" in sys.modules:
        from distributed import KilledWorker
        from distributed.comm import CommClosedError

        lost += (KilledWorker, CommClosedError)
    return isinstance(error, lost)


def iterate_completed(
    waiting: deque[Task], submit: Callable[[Task], Future[Result]], most: int
) -> Iterator[tuple[Task, Future[Result]]]:
    """Run tasks in order, and yield each with its future when it is done.

    Parameters
    ----------
    waiting: tasks, which are removed when they start; the caller may add some until the end.
    submit: starts a task.
    most: maximum number of running tasks.
    """
    running: dict[Future[Result], Task] = {}
    while waiting or running:
        while waiting and len(running) < most:
            task = waiting.popleft()
            running[submit(task)] = task
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            yield running.pop(future), future


ITEMS_PER_TASK = 64
"""Maximum number of items of a task of `run_in_batches`."""

FEWEST_TASKS_PER_JOB = 8
"""Minimum number of tasks per worker, if the items suffice, so that all workers end at about the
same time."""

BYTES_PER_TASK = 1_000_000

LONE_RUNS = 3
"""Lost workers after which an item that runs alone is abandoned."""


def run_in_batches(
    items: Sequence[Item],
    submit: Callable[[list[Item]], Future[Result]],
    jobs: int,
    on_result: Callable[[Result], None],
    *,
    size_of: Callable[[Item], int] = lambda item: 0,
    items_per_task: int | None = None,
) -> list[Item]:
    """Run tasks of a few items each, `jobs` at a time. Items of lost workers are retried at the
    end, one at a time.

    Parameters
    ----------
    submit: starts a task.
    on_result: called with the result of each task.
    size_of: bytes of an item; a task has at most `BYTES_PER_TASK`, or one item.
    items_per_task: maximum number of items of a task; None for a number that suits quick ones.

    Returns the items that lost their worker in each of `LONE_RUNS` lone runs. Raises DiceError if
    the executor fails.
    """
    most = items_per_task or min(ITEMS_PER_TASK, -(-len(items) // (FEWEST_TASKS_PER_JOB * jobs)))
    tasks, size = list[list[Item]](), 0
    for item in items:
        if not tasks or len(tasks[-1]) == most or size + size_of(item) > BYTES_PER_TASK:
            tasks.append([])
            size = 0
        tasks[-1].append(item)
        size += size_of(item)
    for run in range(1 + LONE_RUNS):
        lost: list[Item] = []
        # One running and one waiting task per worker.
        at_once = 1 if run else 2 * jobs
        for task, future in iterate_completed(deque(tasks), submit, at_once):
            try:
                result = future.result()
            except Exception as error:
                if not is_lost_worker(error):
                    raise
                lost += task
            else:
                on_result(result)
        tasks = [[item] for item in lost]
    return lost


def in_order(tasks: Sequence[Callable[[], Result]], workers: Executor) -> Iterator[Result]:
    """Yield results of tasks in order; tasks of lost workers are retried.

    Raises DiceError if workers are lost repeatedly, or the executor fails.
    """
    waiting, losses = deque(range(len(tasks))), [0] * len(tasks)
    results: dict[int, Result] = {}
    place = 0
    for ended_place, future in iterate_completed(
        waiting, lambda place: workers.submit(tasks[place]), len(tasks)
    ):
        try:
            results[ended_place] = future.result()
        except Exception as error:
            if not is_lost_worker(error):
                raise
            losses[ended_place] += 1
            if losses[ended_place] == MOST_LOSSES:
                raise DiceError(
                    f"workers: expected some that stay, but {MOST_LOSSES} were lost while one task "
                    "ran; see whether memory suffices or take fewer --jobs"
                ) from error
            waiting.append(ended_place)
        while place in results:
            yield results.pop(place)
            place += 1


TERMINAL_INTERVAL = 1.0
"""Seconds after which a line on a terminal is updated even without progress."""

PIPE_INTERVAL = 10.0
"""Seconds between lines of progress where stderr is no terminal."""

TIME_USED = "{desc}: {elapsed}{postfix}"
"""Format of work whose amount is unknown."""


@contextmanager
def progress_bar(unit: str, total: int | None = None, done: int = 0) -> Iterator[tqdm[Any]]:
    """Progress on stderr: a bar on a terminal, elsewhere a line every `PIPE_INTERVAL` seconds.

    unit: unit of work, in the plural; total: amount of work; done: work done before. Without a
    total, unit is the name of the work.
    """
    from tqdm import tqdm

    on_terminal, ended = sys.stderr.isatty(), threading.Event()

    def show() -> None:
        while not ended.wait(TERMINAL_INTERVAL if on_terminal else PIPE_INTERVAL):
            with suppress(OSError, ValueError):
                if on_terminal:
                    bar.refresh()
                else:
                    print(bar, file=sys.stderr, flush=True)

    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        # A bar that is made by half prints an error when it is discarded.
        with hold_interrupts():
            bar = tqdm(
                file=sys.stderr if on_terminal else nowhere,
                # No bar in lines of text.
                ncols=None if on_terminal else 0,
            )
        with bar:
            show_part(bar, done, total, unit)
            ticker = threading.Thread(target=show, daemon=True)
            ticker.start()
            try:
                yield bar
            finally:
                ended.set()
                ticker.join()


def show_part(bar: tqdm[Any], done: int, total: int | None, unit: str) -> None:
    """Show how much of an amount of work is done; another amount or unit, or less done than before,
    begins anew.

    total: amount of work, None if unknown. unit: as in `progress_bar`.
    """
    if (total, f" {unit}") == (bar.total, bar.unit) and done >= bar.n:
        bar.update(done - bar.n)
        return
    bar.total, bar.unit, bar.bar_format = total, f" {unit}", None if total else TIME_USED
    if total is None:
        bar.set_description_str(unit, refresh=False)
    bar.set_postfix_str("", refresh=False)
    bar.reset()
    bar.n = bar.initial = bar.last_print_n = done
