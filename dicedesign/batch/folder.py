"""The meshes in a folder."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import OWN_ENDINGS, mesh_endings

__all__ = ["FolderFiles", "list_folder"]


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
