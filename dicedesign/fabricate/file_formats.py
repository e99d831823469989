"""A solid as a file for printing and for other programs, in the format of its ending."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.registry import Extension, Registry

BODY_COLOR: Final = "#e8e3d8"
LABEL_COLOR: Final = "#1f2933"
"""Of a die, and of its labels."""


def _read(path: Path) -> tuple[Floats, Integers]:
    from dicedesign.geometry.meshes.reading import read_body

    body = read_body(path)
    if body.triangles is None:
        raise InputError(f"{path}: expected triangles, got points alone; write the file again")
    return body.points, body.triangles


@dataclass(frozen=True, eq=False)
class Part:
    """A body in one material, perhaps with labels in another colour.

    Attributes
    ----------
    name: such as "die"; color: "#rrggbb".
    points: (n, 3) in mm, z upward; triangles: (t, 3) counter-clockwise seen from outside.
    labels: (t,) which triangles belong to labels, or None where it has none.
    """

    name: str
    color: str
    points: Floats
    triangles: Integers
    labels: Booleans | None = None

    def groups(self) -> list[tuple[str, str, Integers]]:
        """Name, colour and triangles (s, 3) of each colour that the part has."""
        if self.labels is None or not self.labels.any():
            return [(self.name, self.color, self.triangles)]
        return [
            (self.name, self.color, self.triangles[~self.labels]),
            ("labels", LABEL_COLOR, self.triangles[self.labels]),
        ]


@dataclass(frozen=True, eq=False)
class Contents:
    """What a file holds.

    Attributes
    ----------
    title: name of the die.
    parts: at least one, all in the same coordinates.
    facts: texts by a word each, such as Target, for formats that can hold them.
    unit: what lengths are in, for formats with room for a remark.
    """

    title: str
    parts: Sequence[Part]
    facts: Mapping[str, str] = field(default_factory=dict)
    unit: str = "millimetres"


@dataclass(frozen=True, kw_only=True)
class FileFormat(Extension):
    """A format; `name` is the ending of its files without the point.

    Attributes
    ----------
    unit: of lengths, "mm" or "m"; upward: axis of the file along the die's z, "z" or "y".
    precision: of coordinates, "float32" or "float64".
    carries: what a file holds beside the solid, in words.
    write: the content of a file; the same for the same contents.
    read: points (n, 3) and triangles (t, 3) of a file, in its own unit and axes, by other code than
        what wrote it where there is some.
    require: raises InputError where a library that it needs is not installed.
    """

    write: Callable[[Contents], bytes]
    unit: str = "mm"
    upward: str = "z"
    precision: str = "float64"
    carries: str = "nothing else"
    read: Callable[[Path], tuple[Floats, Integers]] = _read
    require: Callable[[], object] = bool

    @property
    def frame(self) -> Floats:
        """(3, 3) from mm with z upward to what the file has: a turn and a scale."""
        scale = {"mm": 1.0, "m": 1e-3}[self.unit]
        turn = {"z": np.eye(3), "y": [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]}
        return scale * np.array(turn[self.upward])

    @property
    def same_odds(self) -> float:
        """Largest difference of the odds of a solid by its file from those of the solid."""
        return {"float32": 1e-6, "float64": 1e-9}[self.precision]

    def read_back(self, path: Path) -> tuple[Floats, Integers]:
        """Points (n, 3) in mm, z upward, and triangles (t, 3) of a file. Raises MeshFileError."""
        points, triangles = self.read(path)
        return points @ np.linalg.inv(self.frame).T, triangles


FILE_FORMATS: Final = Registry(
    "file format",
    FileFormat,
    builtin=(
        "dicedesign.fabricate.mesh_writers:STL",
        "dicedesign.fabricate.mesh_writers:THREE_MF",
        "dicedesign.fabricate.mesh_writers:OBJ",
        "dicedesign.fabricate.mesh_writers:GLB",
        "dicedesign.fabricate.mesh_writers:PLY",
        "dicedesign.fabricate.mesh_writers:OFF",
        "dicedesign.fabricate.step_file:STEP",
    ),
    group="dicedesign.file_formats",
)
"""All formats of solids."""


def joined(parts: Sequence[Part]) -> tuple[Floats, Integers]:
    """Points (n, 3) and triangles (t, 3) of parts as one mesh of several shells."""
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([part.points for part in parts]), np.concatenate(triangles)


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
