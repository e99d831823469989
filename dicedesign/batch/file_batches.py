"""Thousands of files: a few in each task, tasks side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from typing import Final

from dicedesign.batch.analyse import Center, analyse_files
from dicedesign.batch.rows import Entry, Stamp, broken_entry
from dicedesign.runtime.workers import as_ended, is_lost_worker

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
"""Runs of a file with no other beside it after which it counts as the one that takes its worker
down."""

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
    on_quiet: called whenever no task has ended for some seconds.

    Raises DiceError: the executor cannot go on.
    """

    def submit(task: Task) -> Future[dict[str, Entry]]:
        return executor.submit(analyse_files, folder, task, center_of_mass, coplanar_tolerance)

    def losses(tasks: Iterator[Task], most: int) -> Task:
        """Run tasks, so many at a time; the files of those that lost their worker."""
        lost = Task()
        for task, future in as_ended(lambda: next(tasks, None), submit, most, on_quiet):
            try:
                entries = future.result()
            except Exception as error:
                if not is_lost_worker(error):
                    raise
                lost |= task
            else:
                on_entries(entries)
        return lost

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
