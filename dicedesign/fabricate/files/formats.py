"""A solid as a file for printing and for other programs, in the format of its ending."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dicedesign.errors import InputError
from dicedesign.fabricate.files.file_format import (
    BODY_COLOR,
    FILE_FORMATS,
    Contents,
    FileFormat,
    Part,
)
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import atomic_write

__all__ = [
    "file_bytes",
    "format_of_ending",
    "mesh_bytes",
    "save_contents",
    "save_mesh",
    "with_stl",
]


def save_mesh(path: Path, points: Floats, triangles: Integers) -> None:
    """Write a closed triangle mesh to a file, whole or not at all.

    path: the file, in an existing folder; its ending says the format, see `mesh_bytes`.
    points: (n, 3) in mm; triangles: (t, 3) in [0, n), counter-clockwise seen from outside.

    Raises
    ------
    InputError: no format has that ending, or coordinates that the format cannot hold.
    OutputError: the file cannot be written.
    """
    save_contents(path, _of_mesh(points, triangles))


def save_contents(path: Path, contents: Contents) -> None:
    """Write a file, whole or not at all; its ending says the format. Raises as `save_mesh`."""
    kind = format_of_ending(path.suffix, str(path))
    atomic_write(path, file_bytes(contents, kind, str(path)))


def mesh_bytes(points: Floats, triangles: Integers, ending: str, name: str = "mesh file") -> bytes:
    """The content of a mesh file, the same for the same mesh.

    Parameters
    ----------
    points: (n, 3) in mm.
    triangles: (t, 3) in [0, n), counter-clockwise seen from outside.
    ending: "." and the name of a format of `FILE_FORMATS`, in upper or lower case.
    name: what messages call the file.

    Raises
    ------
    InputError: another ending; a coordinate is not finite, or not in the format's precision; a
        library that the format needs is missing.
    """
    return file_bytes(_of_mesh(points, triangles), format_of_ending(ending, name), name)


def format_of_ending(ending: str, name: str = "mesh file") -> FileFormat:
    """The format whose files end in "." and its name. Raises InputError where there is none.

    name: what messages call the file.
    """
    if ending[:1] != "." or ending[1:].lower() not in FILE_FORMATS:
        endings = ", ".join(f".{known}" for known in FILE_FORMATS.names)
        raise InputError(
            f"{name}: expected a file ending out of {endings}, got {ending!r}; choose one of them"
        )
    return FILE_FORMATS[ending[1:].lower()]


def with_stl(names: Sequence[str], key: str = "files") -> list[str]:
    """Names of formats, each once, with STL before the others. Raises InputError where there is no
    such format, or a library that it needs is missing.

    key: what messages about an unknown format begin with.
    """
    for name in names:
        if name not in FILE_FORMATS:
            raise InputError(
                f"{key}: expected formats out of {', '.join(FILE_FORMATS.names)}, got {name!r}; "
                "choose among them"
            )
        FILE_FORMATS[name].require()
    return list(dict.fromkeys(["stl", *names]))


def file_bytes(contents: Contents, kind: FileFormat, name: str = "mesh file") -> bytes:
    """The content of a file of a format, the same for the same contents. Raises as `mesh_bytes`.

    name: what messages call the file.
    """
    kind.require()
    for part in contents.parts:
        rounded = part.points
        if kind.precision == "float32":
            with np.errstate(over="ignore"):
                rounded = rounded.astype(np.float32)
        finite = np.isfinite(rounded).all(axis=1)
        if not finite.all():
            row = int(np.argmin(finite))
            raise InputError(
                f"{name}: expected coordinates that are finite in {kind.precision}, got "
                f"{part.points[row].tolist()} in row {row}; repair or scale the solid"
            )
    return kind.write(contents)


def _of_mesh(points: Floats, triangles: Integers) -> Contents:
    places = np.asarray(points, dtype=np.float64)
    faces = np.asarray(triangles, dtype=np.int64)
    return Contents("die", [Part("die", BODY_COLOR, places, faces)])
