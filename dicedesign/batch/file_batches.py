"""Thousands of files: a few in each task, tasks side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from itertools import islice
from typing import Final

from dicedesign.batch.analyse import Center, analyse_files
from dicedesign.batch.rows import Entry, Stamp, broken_entry
from dicedesign.runtime.executors import is_lost_worker

__all__ = ["run_batch"]

FILES_PER_TASK: Final = 64
"""Files of one task, at most: handing it over costs far less than they do."""

FEWEST_TASKS_PER_JOB: Final = 8
"""Tasks in all over the number of workers, if the files suffice, so that all workers end at about
the same time."""

BYTES_PER_TASK: Final = 1_000_000
"""Bytes of one task's files together; a larger file is a task of its own."""

TASKS_PER_JOB: Final = 2
"""One that runs, and one that waits for it to end."""

ATTEMPTS: Final = 3
"""How often a file runs with no other beside it before it counts as the one that takes its worker
down."""

QUIET: Final = 10.0
"""Seconds without a result after which a caller is told so."""

Task = dict[str, Stamp]


def run_batch(
    folder: str,
    stamps: Mapping[str, Stamp],
    executor: Executor,
    jobs: int,
    center_of_mass: Center = None,
    coplanar_tolerance: float | None = None,
    *,
    on_entries: Callable[[dict[str, Entry]], None],
    on_quiet: Callable[[], None] | None = None,
) -> None:
    """Analyse files of a folder. Files whose worker was lost run again at the end, one at a time,
    so that none is blamed for another.

    Parameters
    ----------
    folder, stamps, center_of_mass, coplanar_tolerance: see `analyse_files`.
    executor: runs it; processes or machines that can import this package and see the folder.
    jobs: how many workers there are, at least 1.
    on_entries: called with the entries of each task once it has ended.
    on_quiet: called whenever no task has ended for `QUIET` seconds.

    Raises DiceError: the executor cannot go on.
    """

    def losses(tasks: Iterable[Task], most: int) -> Task:
        """Run tasks, so many at a time; the files of those that lost their worker."""
        waiting, lost = iter(tasks), Task()
        flights: dict[Future[dict[str, Entry]], Task] = {}
        while True:
            for task in islice(waiting, most - len(flights)):
                future = executor.submit(
                    analyse_files, folder, task, center_of_mass, coplanar_tolerance
                )
                flights[future] = task
            if not flights:
                return lost
            ended, _ = wait(flights, timeout=QUIET, return_when=FIRST_COMPLETED)
            if not ended and on_quiet is not None:
                on_quiet()
            for future in ended:
                task = flights.pop(future)
                error = future.exception()
                if error is None:
                    on_entries(future.result())
                elif is_lost_worker(error):
                    lost |= task
                else:
                    raise error

    most = min(FILES_PER_TASK, -(-len(stamps) // (FEWEST_TASKS_PER_JOB * jobs)))
    lost = losses(_tasks(stamps, most), TASKS_PER_JOB * jobs)
    for _ in range(ATTEMPTS):
        lost = losses(({file: stamp} for file, stamp in lost.items()), 1)
    for file, stamp in lost.items():
        reason = (
            f"{file}: expected workers that stay, but all {ATTEMPTS} that analysed it were lost; "
            "see whether memory suffices"
        )
        on_entries({file: broken_entry(file, stamp, reason)})


def _tasks(stamps: Mapping[str, Stamp], most: int) -> Iterator[Task]:
    """Tasks of at most so many files."""
    task, size = Task(), 0
    for file, stamp in stamps.items():
        if task and (len(task) == most or size + stamp.size > BYTES_PER_TASK):
            yield task
            task, size = Task(), 0
        task[file] = stamp
        size += stamp.size
    if task:
        yield task
