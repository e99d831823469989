"""Workers for many tasks, with a bar on stderr for what they have done."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tqdm import tqdm

__all__ = ["Workers", "open_workers", "progress_bar"]


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
    told: bool = False

    def advance(self, count: int) -> None:
        """So many more pieces are done."""
        self.told = False
        self.bar.update(count)

    def on_quiet(self) -> None:
        """Say once, where nothing was done for a while, that a cluster has no worker left."""
        from dicedesign.runtime.executors import no_worker_left

        if not self.told and no_worker_left(self.executor):
            self.told = True
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

    Raises as `dicedesign.runtime.executors.cluster_workers`.
    """
    from dicedesign.runtime.executors import cluster_workers, local_workers

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
