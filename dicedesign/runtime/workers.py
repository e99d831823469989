"""Workers for many tasks: local processes or a Dask cluster, loops over tasks, thread limits."""

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
    """Let torch use one thread meanwhile: tensors here are far too small to share among threads,
    and processes often run side by side, one on each core."""
    torch = import_module("torch")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch and the BLAS of NumPy and SciPy use one thread meanwhile: sums are then taken in
    one order, and the same numbers come of them however many cores there are."""
    # Imported late: only long searches need it.
    from threadpoolctl import threadpool_limits

    with one_tensor_thread(), threadpool_limits(1):
        yield


PATIENCE: Final = 30.0
"""Seconds that a cluster may take to answer."""

PACKAGE_VERSION: Final = version("dicedesign")
"""Of this package; the workers of a cluster need the same."""

QUIET: Final = 10.0
"""Seconds without a result after which a caller is notified."""

MOST_LOSSES: Final = 5
"""Losses of workers while one task runs after which it is given up."""

UNFIT_CERTIFICATES: Final = (FileNotFoundError, PermissionError, TypeError, RuntimeError)
"""What Dask raises, beside errors of ssl, where certificates cannot be read, where there are none
for an address that begins with tls://, and where its configuration demands these and the address
has none."""

Task = TypeVar("Task")

Item = TypeVar("Item")

Result = TypeVar("Result")


class _LocalWorkers(Executor):
    """Processes that are started again when one of them dies, which fails what they all ran."""

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
        """Without `wait`, what is running ends at once."""
        if not wait:
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()
        self._pool.shutdown(wait=True, cancel_futures=cancel_futures)


def _begin_worker() -> None:
    """Leave interrupts to the parent, and end with it even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


@contextmanager
def local_workers(jobs: int) -> Iterator[Executor]:
    """Local process pool of `jobs` workers; dead ones are replaced."""
    workers = _LocalWorkers(jobs)
    try:
        yield workers
    finally:
        workers.shutdown(wait=False, cancel_futures=True)


class _ClusterWorkers(Executor):
    """A Dask client as an executor that says so when the scheduler has gone for good."""

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address
        # Without `pure`, a task that is submitted again runs again.
        self._workers: Executor = client.get_executor(pure=False)

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        while self._client.status == "connecting":
            time.sleep(0.1)
        if self._client.status != "running":
            raise DiceError(
                f"--scheduler {self._address}: expected a Dask scheduler until the end, but it has "
                "gone; run the same command to go on"
            )
        return self._workers.submit(function, *args, **kwargs)

    def is_empty(self) -> bool:
        """True if the scheduler answers and has no worker."""
        return self._client.status == "running" and not self._client.scheduler_info()["workers"]


@contextmanager
def cluster_workers(address: str) -> Iterator[tuple[Executor, int]]:
    """The workers of a Dask cluster, and how many tasks they can run at a time. Those that join
    later take tasks that wait; while there are none, tasks wait.

    address: of its scheduler, such as tcp://10.0.0.5:8786, or tls://10.0.0.5:8786 with the
        certificates that the configuration of distributed names.

    Raises
    ------
    InputError: distributed is not installed here, its certificates are missing or broken, no
        scheduler or worker answers, or the workers have another version of this package, or none.
    DiceError: by `submit`, when the scheduler has gone.
    """
    import ssl

    try:
        from distributed import Client
    except ImportError as error:
        raise missing_extra("cluster", "--scheduler", error) from error
    log = logging.getLogger("distributed.client")
    level = log.level
    # What it would log is said here by errors.
    log.setLevel(logging.CRITICAL)
    client = None
    try:
        try:
            try:
                client = Client(address, timeout=PATIENCE, set_as_default=False)
            except AssertionError:
                # Dask's, where the first messages of a busy scheduler come together.
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
            # Nobody wants what still runs there then, or that Dask finds it not closed in time.
            with suppress(AssertionError):
                client.close(timeout=PATIENCE)
        log.setLevel(level)


def _is_encrypted(address: str) -> bool:
    """Whether certificates matter for a scheduler."""
    import dask

    required = dask.config.get("distributed.comm.require-encryption", default=False)
    return address.startswith("tls://") or bool(required)


def _check_versions(client: Any, address: str) -> None:
    wanted = f"--scheduler {address}: expected workers with dicedesign {PACKAGE_VERSION}"
    try:
        versions = set(client.run(_installed_version).values())
    except Exception as error:
        # Errors of the workers come in types of their own, or in none.
        raise InputError(f"{wanted}, but {error}; install it where they run") from error
    if versions != {PACKAGE_VERSION}:
        raise InputError(
            f"{wanted}, got {', '.join(sorted(versions))}; install the same version everywhere"
        )


def _installed_version() -> str:
    return PACKAGE_VERSION


def has_no_workers(executor: Executor) -> bool:
    """True if tasks of `cluster_workers` wait because all workers have gone."""
    return isinstance(executor, _ClusterWorkers) and executor.is_empty()


def is_lost_worker(error: BaseException) -> bool:
    """True if a future failed because its worker went away, not because of what it ran."""
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
    """Tasks with their futures, each once it has ended, whether well or not.

    Parameters
    ----------
    next_task: the next one, None if there is none for now; asked again whenever some have ended,
        until there is none and none runs.
    submit: begins it.
    most: how many run at a time.
    on_quiet: called whenever none has ended for `QUIET` seconds.
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
"""Items of one task of `run_in_batches`, at most: handing it over costs far less than they do."""

FEWEST_TASKS_PER_JOB: Final = 8
"""Tasks in all over the number of workers, if the items suffice, so that all workers end at about
the same time."""

BYTES_PER_TASK: Final = 1_000_000

LONE_RUNS: Final = 3
"""Runs of an item with no other beside it after which it counts as the one that takes its worker
down."""


def run_in_batches(
    items: Sequence[Item],
    submit: Callable[[list[Item]], Future[Result]],
    jobs: int,
    on_result: Callable[[Result], None],
    on_quiet: Callable[[], None] | None = None,
    *,
    size_of: Callable[[Item], int] = lambda item: 0,
) -> list[Item]:
    """Run tasks of a few items each, `jobs` at a time. Items whose worker was lost run again at the
    end, one at a time, so that none is blamed for another.

    Parameters
    ----------
    submit: begins the task of some items.
    on_result: called with what each task returned.
    on_quiet: called whenever no task has ended for `QUIET` seconds.
    size_of: bytes of an item; those of a task come to at most `BYTES_PER_TASK`, or it has one item.

    Returns the items that lost their worker each of `LONE_RUNS` times that they ran alone. Raises
    DiceError: the executor cannot go on.
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
        # One that runs and one that waits for it to end, for each worker.
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
    """Results of tasks, in their order. One whose worker is lost runs again.

    on_quiet: called whenever the task that is waited for has not ended for `QUIET` seconds.

    Raises DiceError: workers are lost again and again, or the executor cannot go on.
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
                # A local worker that is lost fails all that was submitted.
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
    """Workers, and a bar on stderr for what they do.

    Attributes
    ----------
    executor: runs tasks.
    jobs: how many tasks it runs at a time.
    unit: of work, in the plural.
    bar: counts it.
    scheduler: address of the cluster, or None on this machine.
    """

    executor: Executor
    jobs: int
    unit: str
    bar: tqdm[Any]
    scheduler: str | None
    notified: bool = False

    def advance(self, count: int) -> None:
        """Count finished pieces."""
        self.notified = False
        self.bar.update(count)

    def on_quiet(self) -> None:
        """Say once, where nothing was done for a while, that a cluster has no worker left."""
        if not self.notified and has_no_workers(self.executor):
            self.notified = True
            note = f"note: {self.scheduler} has no worker left; {self.unit} wait for one to join"
            self.bar.write(note, file=sys.stderr)


def progress_bar(unit: str, total: int | None = None, done: int = 0) -> tqdm[Any]:
    """A bar on stderr, hidden unless that is a terminal.

    unit: of work, in the plural; total: pieces of work in all; done: those done before.
    """
    from tqdm import tqdm

    hidden = not sys.stderr.isatty()
    return tqdm(file=sys.stderr, disable=hidden, unit=f" {unit}", total=total, initial=done)


@contextmanager
def open_workers(
    unit: str, total: int, done: int = 0, *, jobs: int | None = None, scheduler: str | None = None
) -> Iterator[Workers]:
    """Workers with their bar.

    Parameters
    ----------
    unit, total, done: as of `progress_bar`.
    jobs: tasks at a time; None takes one for each core, or each thread of the cluster.
    scheduler: address of a Dask cluster's; None runs processes of this machine.

    Raises as `dicedesign.runtime.workers.cluster_workers`.
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
