"""Analysis of many meshes, in parallel tasks of a few files each."""

from __future__ import annotations

import operator
import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import NoReturn

from dicedesign.batch.rest_rows import RestOptions
from dicedesign.batch.rest_table import Entry, Stamp, broken_entry, make_entry
from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.meshes.reading import MESH_ENDINGS, OTHER_ENDINGS
from dicedesign.geometry.robots.bodies import list_bodies
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.workers import LONE_RUNS, run_in_batches


@dataclass(frozen=True)
class FolderFiles:
    """Files in a folder and its subfolders.

    Attributes
    ----------
    meshes: size in bytes and time of the last change in nanoseconds of each mesh or point file,
        also of formats that are not read, by its path in the folder with slashes, in the order of
        the paths.
    others: number of other files.
    """

    meshes: dict[str, tuple[int, int]]
    others: int


def list_folder(folder: Path) -> FolderFiles:
    """List the files of a folder, except hidden ones. Links to folders are not followed.

    Raises InputError: there is no mesh, or a folder cannot be read.
    """
    others = 0
    meshes: dict[str, tuple[int, int]] = {}
    for parent, folders, names in os.walk(folder, onerror=_unreadable):
        folders[:] = [name for name in folders if not name.startswith(".")]
        within = Path(parent).relative_to(folder).as_posix()
        start = "" if within == "." else f"{within}/"
        for name in names:
            if name.startswith("."):
                continue
            if os.path.splitext(name)[1].lower() not in MESH_ENDINGS | OTHER_ENDINGS:
                others += 1
                continue
            meshes[start + name] = file_state(os.path.join(parent, name))
    if not meshes:
        raise InputError(
            f"{folder}: expected a folder with meshes, files ending in "
            f"{', '.join(sorted(MESH_ENDINGS))}, got {others} other files; name another folder"
        )
    return FolderFiles(dict(sorted(meshes.items())), others)


def file_state(path: str | Path) -> tuple[int, int]:
    """Size of a file in bytes and time of its last change in nanoseconds; (0, 0) without one, which
    gets an error when it is read."""
    try:
        status = os.stat(path)
    except OSError:
        return 0, 0
    return status.st_size, status.st_mtime_ns


def _unreadable(error: OSError) -> NoReturn:
    raise InputError(
        f"{error.filename}: expected a readable folder, got {error.strerror!r}; check permissions"
    ) from error


def analyze_files(
    folder: str, stamps: Mapping[str, Stamp], options: RestOptions
) -> dict[str, Entry]:
    """Analyze files of a folder. A body that cannot be analyzed gets a row with the reason.

    folder: path of the folder.
    stamps: stamp of each file, by its path in the folder.
    """
    entries = {}
    for file, stamp in stamps.items():
        path, (center, _), rows = Path(folder, file), options.of_file(file), []
        for source in list_bodies(path):
            started = time.perf_counter()
            try:
                body = source.read()
                poses = rest_poses(body, center, coplanar_tolerance=options.coplanar_tolerance)
                seconds = time.perf_counter() - started
                rows.append(make_entry(file, stamp, source, body, poses, options, seconds))
            except Exception as error:
                # An unexpected error must not end the analysis of the other files.
                text = str(error) if isinstance(error, DiceError) else f"{file}: {error!r}"
                seconds = time.perf_counter() - started
                reason = text.replace(str(path), file)
                rows.append(broken_entry(file, stamp, reason, seconds, source.name))
        entries[file] = reduce(operator.add, rows)
    return entries


def run_batch(
    folder: str,
    stamps: Mapping[str, Stamp],
    executor: Executor,
    jobs: int,
    options: RestOptions,
    *,
    on_entries: Callable[[dict[str, Entry]], None],
) -> None:
    """Analyze files of a folder in parallel. Files whose worker was lost are retried at the end,
    one at a time.

    Parameters
    ----------
    folder, stamps, options: see `analyze_files`.
    executor: processes or machines that can import this package and read the folder.
    jobs: number of workers, at least 1.
    on_entries: called with the entries of each finished task.

    Raises DiceError: the executor is broken.
    """
    lost = run_in_batches(
        list(stamps.items()),
        lambda task: executor.submit(analyze_files, folder, dict(task), options),
        jobs,
        on_entries,
        size_of=lambda item: item[1].size,
    )
    for file, stamp in lost:
        reason = (
            f"{file}: expected workers that stay, but all {LONE_RUNS} that analyzed it were lost; "
            "see whether memory suffices"
        )
        on_entries({file: broken_entry(file, stamp, reason)})
