"""The meshes in a folder, thousands of them analyzed: a few in each task, tasks side by side."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NoReturn

from dicedesign.batch.rest_table import Entry, Stamp, broken_entry, make_entry
from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.meshes.reading import OWN_ENDINGS, mesh_endings
from dicedesign.runtime.workers import LONE_RUNS, run_in_batches


@dataclass(frozen=True)
class FolderFiles:
    """Files in a folder and the folders within.

    Attributes
    ----------
    meshes: size in bytes and time of the last change in nanoseconds of each mesh or point file, by
        its path in the folder with slashes, in the order of the paths.
    others: how many other files there are.
    """

    meshes: dict[str, tuple[int, int]]
    others: int


def list_folder(folder: Path) -> FolderFiles:
    """Files of a folder, those that begin with a dot left out. Links to folders are not followed.

    Raises InputError: there is no mesh, or a folder cannot be read.
    """
    endings, others = OWN_ENDINGS, 0
    meshes: dict[str, tuple[int, int]] = {}
    for parent, folders, names in os.walk(folder, onerror=_unreadable):
        folders[:] = [name for name in folders if not name.startswith(".")]
        within = Path(parent).relative_to(folder).as_posix()
        start = "" if within == "." else f"{within}/"
        for name in names:
            if name.startswith("."):
                continue
            ending = os.path.splitext(name)[1].lower()
            if ending not in endings:
                endings = mesh_endings()
            if ending not in endings:
                others += 1
                continue
            try:
                status = os.stat(os.path.join(parent, name))
                state = (status.st_size, status.st_mtime_ns)
            except OSError:
                # A link that leads nowhere: reading it says so.
                state = (0, 0)
            meshes[start + name] = state
    if not meshes:
        raise InputError(
            f"{folder}: expected a folder with meshes, files ending in "
            f"{', '.join(sorted(mesh_endings()))}, got {others} other files; name another folder"
        )
    return FolderFiles(dict(sorted(meshes.items())), others)


def _unreadable(error: OSError) -> NoReturn:
    raise InputError(
        f"{error.filename}: expected a readable folder, got {error.strerror!r}; check permissions"
    ) from error


Center = tuple[float, float, float] | Literal["hull"] | None
"""A center of mass, as in `rest_poses`."""


def analyze_files(
    folder: str,
    stamps: Mapping[str, Stamp],
    center_of_mass: Center = None,
    coplanar_tolerance: float | None = None,
) -> dict[str, Entry]:
    """Entries of some files. A file that cannot be analyzed gets an entry with the reason.

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
            entries[file] = make_entry(file, stamp, poses, seconds)
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
    """Analyze files of a folder. Files whose worker was lost run again at the end, one at a time,
    so that none is blamed for another.

    Parameters
    ----------
    folder, stamps, center_of_mass, coplanar_tolerance: see `analyze_files`.
    executor: runs it; processes or machines that can import this package and see the folder.
    jobs: how many workers there are, at least 1.
    on_entries: called with the entries of each task once it has ended.
    on_quiet: called whenever no task has ended for some seconds.

    Raises DiceError: the executor cannot go on.
    """

    lost = run_in_batches(
        list(stamps.items()),
        lambda task: executor.submit(
            analyze_files, folder, dict(task), center_of_mass, coplanar_tolerance
        ),
        jobs,
        on_entries,
        on_quiet,
        size_of=lambda item: item[1].size,
    )
    for file, stamp in lost:
        reason = (
            f"{file}: expected workers that stay, but all {LONE_RUNS} that analyzed it were lost; "
            "see whether memory suffices"
        )
        on_entries({file: broken_entry(file, stamp, reason)})
