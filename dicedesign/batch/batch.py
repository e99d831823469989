"""Thousands of files: a few in each task, tasks side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Literal

from dicedesign.batch.rest_table import Entry, Stamp, analysed_entry, broken_entry
from dicedesign.errors import DiceError
from dicedesign.runtime.workers import LONE_RUNS, run_in_batches

Center = tuple[float, float, float] | Literal["hull"] | None
"""A center of mass, as in `rest_poses`."""


def analyse_files(
    folder: str,
    stamps: Mapping[str, Stamp],
    center_of_mass: Center = None,
    coplanar_tolerance: float | None = None,
) -> dict[str, Entry]:
    """The entries of some files. One that cannot be analysed, for whatever reason, gets an entry
    that says so.

    folder: where they are.
    stamps: of each file, by its path within the folder.
    center_of_mass, coplanar_tolerance: see `rest_poses`.
    """
    # Imported by the workers; the process that hands out the work needs none of it.
    from dicedesign.geometry.meshes.reading import read_body, without_solids
    from dicedesign.rest.poses import rest_poses

    entries = {}
    for file, stamp in stamps.items():
        path, started = Path(folder, file), time.perf_counter()
        try:
            with without_solids():
                body = read_body(path)
            poses = rest_poses(body, center_of_mass, coplanar_tolerance=coplanar_tolerance)
            seconds = time.perf_counter() - started
            entries[file] = analysed_entry(file, stamp, poses, seconds)
        except Exception as error:
            # Thousands of files are not given up for one, even where the fault is ours.
            said = str(error) if isinstance(error, DiceError) else f"{file}: {error!r}"
            seconds = time.perf_counter() - started
            reason = said.replace(str(path), file)
            entries[file] = broken_entry(file, stamp, reason, seconds)
    return entries


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

    lost = run_in_batches(
        list(stamps.items()),
        lambda task: executor.submit(
            analyse_files, folder, dict(task), center_of_mass, coplanar_tolerance
        ),
        jobs,
        on_entries,
        on_quiet,
        size_of=lambda item: item[1].size,
    )
    for file, stamp in lost:
        reason = (
            f"{file}: expected workers that stay, but all {LONE_RUNS} that analysed it were lost; "
            "see whether memory suffices"
        )
        on_entries({file: broken_entry(file, stamp, reason)})
