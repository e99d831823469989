"""Analysis of all meshes of a folder, in parallel tasks of a few files each."""

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
from dicedesign.geometry.meshes.reading import OTHER_ENDINGS, OWN_ENDINGS, mesh_endings
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
    endings, others = OWN_ENDINGS | OTHER_ENDINGS, 0
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
                endings |= mesh_endings()
            if ending not in endings:
                others += 1
                continue
            try:
                status = os.stat(os.path.join(parent, name))
                state = (status.st_size, status.st_mtime_ns)
            except OSError:
                # A broken link, which gets an error when it is read.
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
"""Center of mass, as in `rest_poses`."""


def analyze_files(
    folder: str,
    stamps: Mapping[str, Stamp],
    center_of_mass: Center = None,
    coplanar_tolerance: float | None = None,
) -> dict[str, Entry]:
    """Analyze files of a folder. A file that cannot be analyzed gets an entry with the reason.

    folder: path of the folder.
    stamps: stamp of each file, by its path in the folder.
    center_of_mass, coplanar_tolerance: see `rest_poses`.
    """
    # Only the workers need these.
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.rest.poses import rest_poses

    entries = {}
    for file, stamp in stamps.items():
        path, started = Path(folder, file), time.perf_counter()
        try:
            body = read_body(path)
            poses = rest_poses(body, center_of_mass, coplanar_tolerance=coplanar_tolerance)
            seconds = time.perf_counter() - started
            entries[file] = make_entry(file, stamp, poses, seconds)
        except Exception as error:
            # An unexpected error must not end the analysis of the other files.
            text = str(error) if isinstance(error, DiceError) else f"{file}: {error!r}"
            seconds = time.perf_counter() - started
            reason = text.replace(str(path), file)
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
) -> None:
    """Analyze files of a folder in parallel. Files whose worker was lost are retried at the end,
    one at a time.

    Parameters
    ----------
    folder, stamps, center_of_mass, coplanar_tolerance: see `analyze_files`.
    executor: processes or machines that can import this package and read the folder.
    jobs: number of workers, at least 1.
    on_entries: called with the entries of each finished task.

    Raises DiceError: the executor is broken.
    """
    lost = run_in_batches(
        list(stamps.items()),
        lambda task: executor.submit(
            analyze_files, folder, dict(task), center_of_mass, coplanar_tolerance
        ),
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
