"""Local processes or a Dask cluster for many tasks, loops over tasks, and thread limits."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
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
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final, TypeVar

from dicedesign.errors import DiceError, InputError, missing_extra

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


PATIENCE: Final = 30.0
"""Timeout of a cluster in seconds."""

PACKAGE_VERSION: Final = version("dicedesign")
"""Version of this package, which the workers of a cluster need too."""

QUIET: Final = 10.0
"""Seconds without a result after which `on_quiet` is called."""

MOST_LOSSES: Final = 5
"""Number of lost workers after which a task is abandoned."""

UNFIT_CERTIFICATES: Final = (FileNotFoundError, PermissionError, TypeError, RuntimeError)
"""Errors of Dask, besides those of ssl, for unreadable or missing certificates."""

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
        return ProcessPoolExecutor(self._jobs, context, _begin_worker)

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        try:
            return self._pool.submit(function, *args, **kwargs)
        except BrokenExecutor:
            self._pool.shutdown(wait=True)
            self._pool = self._start()
            return self._pool.submit(function, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Shut down the pool; without `wait`, terminate running tasks."""
        if not wait:
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()
        self._pool.shutdown(wait=True, cancel_futures=cancel_futures)


def _begin_worker() -> None:
    """Ignore interrupts, and exit with the parent even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
        workers.shutdown(wait=False, cancel_futures=True)


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

    def is_empty(self) -> bool:
        """Whether the scheduler answers and has no worker."""
        return self._client.status == "running" and not self._client.scheduler_info()["workers"]


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
    import ssl

    try:
        from distributed import Client
    except ImportError as error:
        raise missing_extra("cluster", "--scheduler", error) from error
    log = logging.getLogger("distributed.client")
    level = log.level
    # Errors report what it would log.
    log.setLevel(logging.CRITICAL)
    client = None
    try:
        try:
            try:
                client = Client(address, timeout=PATIENCE, set_as_default=False)
            except AssertionError:
                # Dask fails if the first messages of a busy scheduler arrive together.
                client = Client(address, timeout=PATIENCE, set_as_default=False)
            client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            if isinstance(error, (ssl.SSLError, *UNFIT_CERTIFICATES)) and _is_encrypted(address):
                raise InputError(
                    f"--scheduler {address}: expected certificates for tls:// in Dask's "
                    f"configuration, as under distributed.comm.tls, got: {error}; see "
                    "docs/researchers.md"
                ) from error
            if not isinstance(error, OSError | ValueError):
                raise
            missing = "a Dask scheduler" if client is None else "at least one worker"
            raise InputError(
                f"--scheduler {address}: expected {missing} that answers within {PATIENCE:g} "
                f"seconds, got none; start it with `dask {missing.split()[-1]}`"
                f"{' and certificates that fit those here' * address.startswith('tls://')}"
            ) from error
        _check_versions(client, address)
        yield _ClusterWorkers(client, address), sum(client.nthreads().values())
    finally:
        if client is not None:
            # Abandon tasks that still run, and ignore a slow shutdown.
            with suppress(AssertionError):
                client.close(timeout=PATIENCE)
        log.setLevel(level)


def _is_encrypted(address: str) -> bool:
    """Whether connections to a scheduler need certificates."""
    import dask

    required = dask.config.get("distributed.comm.require-encryption", default=False)
    return address.startswith("tls://") or bool(required)


def _check_versions(client: Any, address: str) -> None:
    expected = f"--scheduler {address}: expected workers with dicedesign {PACKAGE_VERSION}"
    try:
        versions = set(client.run(_package_version).values())
    except Exception as error:
        # Workers raise errors of any type.
        raise InputError(f"{expected}, but {error}; install it where they run") from error
    if versions != {PACKAGE_VERSION}:
        raise InputError(
            f"{expected}, got {', '.join(sorted(versions))}; install the same version everywhere"
        )


def _package_version() -> str:
    return PACKAGE_VERSION


def has_no_workers(executor: Executor) -> bool:
    """Whether all workers of `cluster_workers` are gone, so that tasks wait."""
    return isinstance(executor, _ClusterWorkers) and executor.is_empty()


def is_lost_worker(error: BaseException) -> bool:
    """Whether a future failed because its worker was lost."""
    lost: tuple[type[BaseException], ...] = (BrokenExecutor, CancelledError)
    if "distributed" in sys.modules:
        from distributed import CancelledError as Cancelled
        from distributed import KilledWorker
        from distributed.comm import CommClosedError

        lost += (Cancelled, KilledWorker, CommClosedError)
    return isinstance(error, lost)


def iterate_completed(
    next_task: Callable[[], Task | None],
    submit: Callable[[Task], Future[Result]],
    most: int,
    on_quiet: Callable[[], None] | None = None,
) -> Iterator[tuple[Task, Future[Result]]]:
    """Run tasks, and yield each with its future when it is done.

    Parameters
    ----------
    next_task: returns the next task, or None for now; called again when tasks end, until it returns
        None and no task runs.
    submit: starts a task.
    most: maximum number of running tasks.
    on_quiet: called when no task has ended for `QUIET` seconds.
    """
    running: dict[Future[Result], Task] = {}
    while True:
        while len(running) < most and (task := next_task()) is not None:
            running[submit(task)] = task
        if not running:
            return
        ended, _ = wait(running, timeout=QUIET, return_when=FIRST_COMPLETED)
        if not ended and on_quiet is not None:
            on_quiet()
        for future in ended:
            yield running.pop(future), future


ITEMS_PER_TASK: Final = 64
"""Maximum number of items of a task of `run_in_batches`."""

FEWEST_TASKS_PER_JOB: Final = 8
"""Minimum number of tasks per worker, if the items suffice, so that all workers end at about the
same time."""

BYTES_PER_TASK: Final = 1_000_000

LONE_RUNS: Final = 3
"""Lost workers after which an item that runs alone is abandoned."""


def run_in_batches(
    items: Sequence[Item],
    submit: Callable[[list[Item]], Future[Result]],
    jobs: int,
    on_result: Callable[[Result], None],
    on_quiet: Callable[[], None] | None = None,
    *,
    size_of: Callable[[Item], int] = lambda item: 0,
) -> list[Item]:
    """Run tasks of a few items each, `jobs` at a time. Items of lost workers are retried at the
    end, one at a time.

    Parameters
    ----------
    submit: starts a task.
    on_result: called with the result of each task.
    on_quiet: called when no task has ended for `QUIET` seconds.
    size_of: bytes of an item; a task has at most `BYTES_PER_TASK`, or one item.

    Returns the items that lost their worker in each of `LONE_RUNS` lone runs. Raises DiceError if
    the executor fails.
    """
    most = min(ITEMS_PER_TASK, -(-len(items) // (FEWEST_TASKS_PER_JOB * jobs)))
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
        for task, future in iterate_completed(
            partial(next, iter(tasks), None), submit, at_once, on_quiet
        ):
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


def in_order(
    tasks: Sequence[Callable[[], Result]],
    workers: Executor,
    on_quiet: Callable[[], None] | None = None,
) -> Iterator[Result]:
    """Yield results of tasks in order; tasks of lost workers are retried.

    on_quiet: called when the next result has not come for `QUIET` seconds.

    Raises DiceError if workers are lost repeatedly, or the executor fails.
    """
    futures = [workers.submit(task) for task in tasks]
    for place in range(len(tasks)):
        losses = 0
        while True:
            try:
                result = futures[place].result(QUIET)
            except TimeoutError:
                if on_quiet is not None:
                    on_quiet()
            except Exception as error:
                if not is_lost_worker(error):
                    raise
                losses += 1
                if losses == MOST_LOSSES:
                    raise DiceError(
                        f"workers: expected some that stay, but {losses} were lost while one task "
                        "ran; see whether memory suffices or take fewer --jobs"
                    ) from error
                # A lost local worker fails all submitted tasks.
                for k in range(place, len(tasks)):
                    if _has_lost_worker(futures[k]):
                        futures[k] = workers.submit(tasks[k])
            else:
                yield result
                break


def _has_lost_worker(future: Future[Any]) -> bool:
    if not future.done():
        return False
    if future.cancelled():
        return True
    error = future.exception()
    return error is not None and is_lost_worker(error)


@dataclass
class Workers:
    """Workers with a progress bar on stderr.

    Attributes
    ----------
    executor: executor of tasks.
    jobs: number of parallel tasks.
    unit: unit of work, in the plural.
    bar: progress bar.
    scheduler: address of the cluster, None on this machine.
    has_warned: whether it reported that no worker is left.
    """

    executor: Executor
    jobs: int
    unit: str
    bar: tqdm[Any]
    scheduler: str | None
    has_warned: bool = False

    def advance(self, count: int) -> None:
        """Count finished work."""
        self.has_warned = False
        self.bar.update(count)

    def on_quiet(self) -> None:
        """Report once that a cluster has no worker left."""
        if not self.has_warned and has_no_workers(self.executor):
            self.has_warned = True
            note = f"note: {self.scheduler} has no worker left; {self.unit} wait for one to join"
            self.bar.write(note, file=sys.stderr)


def progress_bar(unit: str, total: int | None = None, done: int = 0) -> tqdm[Any]:
    """Progress bar on stderr, hidden unless that is a terminal.

    unit: unit of work, in the plural; total: amount of work; done: work done before.
    """
    from tqdm import tqdm

    hidden = not sys.stderr.isatty()
    return tqdm(file=sys.stderr, disable=hidden, unit=f" {unit}", total=total, initial=done)


@contextmanager
def open_workers(
    unit: str, total: int, done: int = 0, *, jobs: int | None = None, scheduler: str | None = None
) -> Iterator[Workers]:
    """Open workers with a progress bar.

    Parameters
    ----------
    unit, total, done: as in `progress_bar`.
    jobs: number of parallel tasks; None for one per core, or per thread of the cluster.
    scheduler: address of a Dask cluster; None for local processes.

    Raises as `cluster_workers`.
    """
    with contextlib.ExitStack() as stack:
        executor: Executor
        if scheduler is None:
            jobs = min(jobs or os.cpu_count() or 1, total - done)
            executor = stack.enter_context(local_workers(jobs))
        else:
            executor, threads = stack.enter_context(cluster_workers(scheduler))
            jobs = jobs or threads
        bar = stack.enter_context(progress_bar(unit, total, done))
        yield Workers(executor, jobs, unit, bar, scheduler)
