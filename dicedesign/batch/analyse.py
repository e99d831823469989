"""A worker's task: a few meshes of a folder are analysed."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from dicedesign.batch.rows import Entry, Stamp, analysed_entry, broken_entry
from dicedesign.errors import DiceError

__all__ = ["Center", "analyse_files"]

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
    from dicedesign.geometry.meshes.formats import without_solids
    from dicedesign.geometry.meshes.reading import read_body
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
