"""Formats of files of solids: one file each, and what a file holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension

__all__ = ["BODY_COLOR", "FILE_FORMATS", "LABEL_COLOR", "Contents", "FileFormat", "Part", "joined"]

BODY_COLOR: Final = "#e8e3d8"
LABEL_COLOR: Final = "#1f2933"
"""Of a die, and of its labels."""

_SAME_ODDS: Final = {"float32": 1e-6, "float64": 1e-9}
"""Largest difference between odds of one solid in coordinates of a precision and in float64."""


def _nothing() -> None:
    pass


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

    unit: str
    upward: str
    precision: str
    carries: str
    write: Callable[[Contents], bytes]
    read: Callable[[Path], tuple[Floats, Integers]] = _read
    require: Callable[[], None] = _nothing

    @property
    def frame(self) -> Floats:
        """(3, 3) from mm with z upward to what the file has: a turn and a scale."""
        scale = {"mm": 1.0, "m": 1e-3}[self.unit]
        turn = {"z": np.eye(3), "y": [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]}
        return scale * np.array(turn[self.upward])

    @property
    def same_odds(self) -> float:
        """Largest difference of the odds of a solid by its file from those of the solid."""
        return _SAME_ODDS[self.precision]

    def read_back(self, path: Path) -> tuple[Floats, Integers]:
        """Points (n, 3) in mm, z upward, and triangles (t, 3) of a file. Raises MeshFileError."""
        points, triangles = self.read(path)
        return points @ np.linalg.inv(self.frame).T, triangles


FILE_FORMATS: Final = FolderRegistry[FileFormat](
    "file format", "dicedesign.fabricate.files.kinds", FileFormat
)
"""All formats of solids."""


def joined(parts: Sequence[Part]) -> tuple[Floats, Integers]:
    """Points (n, 3) and triangles (t, 3) of parts as one mesh of several shells."""
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([part.points for part in parts]), np.concatenate(triangles)
