"""Workers for many tasks, with a bar on stderr for what they have done."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

__all__ = ["Workers", "open_workers"]


@dataclass
class Workers:
    """Workers, and a bar on stderr for what they do.

    Attributes
    ----------
    executor: runs tasks.
    jobs: how many tasks it runs at a time.
    unit: of work, in the plural.
    bar: a tqdm bar that counts it, hidden unless stderr is a terminal.
    scheduler: address of the cluster, or None on this machine.
    """

    executor: Executor
    jobs: int
    unit: str
    bar: Any
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


@contextmanager
def open_workers(
    options: argparse.Namespace, unit: str, total: int, done: int
) -> Iterator[Workers]:
    """The workers that the options ask for.

    unit: of work, in the plural; total: pieces of work in all; done: those done before. Raises as
    `dicedesign.runtime.executors.cluster_workers`.
    """
    from tqdm import tqdm

    from dicedesign.runtime.executors import cluster_workers, local_workers

    with contextlib.ExitStack() as stack:
        executor: Executor
        if options.scheduler is None:
            jobs = min(options.jobs or os.cpu_count() or 1, total - done)
            executor = stack.enter_context(local_workers(jobs))
        else:
            executor, threads = stack.enter_context(cluster_workers(options.scheduler))
            jobs = options.jobs or threads
        bar = stack.enter_context(
            tqdm(
                file=sys.stderr,
                disable=not sys.stderr.isatty(),
                unit=f" {unit}",
                total=total,
                initial=done,
            )
        )
        yield Workers(executor, jobs, unit, bar, options.scheduler)
