"""Readers of the plain text formats OBJ, OFF and XYZ: positions and faces, nothing else.

They take polygons of any size, relative OBJ indices, comments and any separator, and say on which
line a file is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import MeshFileError
from dicedesign.runtime.arrays import Floats, Integers

__all__ = [
    "EXPORT_AGAIN",
    "TEXT_READERS",
    "Geometry",
    "bad_line",
    "parsed_obj",
    "parsed_off",
    "parsed_xyz",
]

Geometry = tuple[Floats, Integers]

Line = tuple[int, list[str]]

EXPORT_AGAIN: Final = "export it again as STL, PLY or OBJ"
"""The remedy for a file that is wrong as a whole."""

QUOTED: Final = 40
"""Characters of a wrong line that are quoted."""

MOST_INDEX: Final = 2**31
"""No mesh has so many vertices."""

DECIMAL_COMMA: Final = re.compile(r"[-+]?\d*,\d+")
"""A number with a comma for its point."""


def parsed_obj(data: bytes, path: Path) -> Geometry:
    """Positions and fan-triangulated faces of a Wavefront OBJ file.

    Texture and normal indices are skipped, so seams in them do not split vertices. Groups and
    objects are joined. A fan has the signed volume and centroid of its polygon, convex or not.

    Parameters
    ----------
    data: content of the file; path: what to call it in messages.

    Returns
    -------
    (n, 3) points and (t, 3) zero-based triangles, t = 0 for a point cloud; not yet checked
    against n.

    Raises
    ------
    MeshFileError: a `v` or `f` line cannot be read.
    """
    points: list[float] = []
    triangles: list[int] = []
    for number, fields in _lines(data):
        if fields[0] == "v":
            points += _position(path, number, fields[1:4])
        elif fields[0] == "f":
            corners = [field.partition("/")[0] for field in fields[1:]]
            indices = _integers(path, number, corners)
            if 0 in indices:
                raise bad_line(path, number, "vertex numbers other than 0", " ".join(fields))
            polygon = [i - 1 if i > 0 else len(points) // 3 + i for i in indices]
            triangles += _fan(path, number, fields, polygon)
    return _arrays(points, triangles)


def parsed_off(data: bytes, path: Path) -> Geometry:
    """Positions and fan-triangulated faces of an ASCII OFF file, colored or not.

    Parameters, results and errors are those of `parsed_obj`.
    """
    lines = list(_lines(data))
    if not lines or lines[0][1][0].upper() not in {"OFF", "COFF", "NOFF", "CNOFF"}:
        raise MeshFileError(
            f"{path}: expected an ASCII OFF file, whose first line is OFF, got another first line; "
            f"{EXPORT_AGAIN}"
        )
    number, header = lines[0]
    if len(header) > 1:
        lines[0] = (number, header[1:])
    else:
        del lines[0]
    counts = _integers(path, lines[0][0], lines[0][1][:2]) if lines else []
    if len(counts) != 2 or min(counts) < 0 or len(lines) - 1 < sum(counts):
        raise MeshFileError(
            f"{path}: expected the numbers of vertices and faces and then as many lines, got "
            f"{counts} and {max(len(lines) - 1, 0)} lines; export the file again"
        )
    rows, faces = lines[1 : 1 + counts[0]], lines[1 + counts[0] : 1 + sum(counts)]
    points: list[float] = []
    for number, fields in rows:
        points += _position(path, number, fields[:3])
    triangles: list[int] = []
    for number, fields in faces:
        (size,) = _integers(path, number, fields[:1])
        polygon = _integers(path, number, fields[1 : 1 + size])
        if len(polygon) != size:
            raise bad_line(path, number, f"{size} vertex numbers", " ".join(fields))
        triangles += _fan(path, number, fields, polygon)
    return _arrays(points, triangles)


def parsed_xyz(data: bytes, path: Path) -> Geometry:
    """Points of a text file, the first three numbers of every line; further columns are skipped.

    Parameters, results and errors are those of `parsed_obj`, without triangles.
    """
    points: list[float] = []
    for number, words in _lines(data):
        if len(words) >= 3 and all(DECIMAL_COMMA.fullmatch(word) for word in words[:3]):
            raise bad_line(path, number, "decimal points", " ".join(words))
        fields = " ".join(words).replace(",", " ").replace(";", " ").split()
        points += _position(path, number, fields[:3])
    return _arrays(points, [])


TEXT_READERS: Final[dict[str, Callable[[bytes, Path], Geometry]]] = {
    ".obj": parsed_obj,
    ".off": parsed_off,
    ".xyz": parsed_xyz,
}
"""The reader of each file ending, in lower case."""


def _lines(data: bytes) -> Iterator[Line]:
    """Number and fields of every line that holds any, comments and continuations resolved."""
    text = data.decode("utf-8-sig", errors="replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    pending, start = "", 0
    for number, line in enumerate(lines, start=1):
        start = start or number
        if "#" in line:
            line = line.partition("#")[0]
        line = pending + line.rstrip()
        if line.endswith("\\"):
            pending = line[:-1]
            continue
        if fields := line.split():
            yield start, fields
        pending, start = "", 0


def _position(path: Path, number: int, fields: Sequence[str]) -> tuple[float, float, float]:
    try:
        x, y, z = fields
        position = float(x), float(y), float(z)
        # float() would take "1_0" as 10.
        if "_" in x + y + z:
            raise ValueError
        return position
    except ValueError as error:
        raise bad_line(path, number, "three coordinates", " ".join(fields)) from error


def _integers(path: Path, number: int, fields: Sequence[str]) -> list[int]:
    try:
        numbers = list(map(int, fields))
        # int() would take "1_0" as 10, and numbers that no array holds.
        if "_" in "".join(fields) or max(map(abs, numbers), default=0) > MOST_INDEX:
            raise ValueError
        return numbers
    except ValueError as error:
        raise bad_line(path, number, "whole numbers", " ".join(fields)) from error


def _fan(path: Path, number: int, fields: Sequence[str], polygon: list[int]) -> list[int]:
    """Corners of its triangles, one after the other."""
    if len(polygon) == 3:
        return polygon
    if len(polygon) < 3:
        raise bad_line(path, number, "a face of at least 3 vertices", " ".join(fields))
    return [i for b, c in pairwise(polygon[1:]) for i in (polygon[0], b, c)]


def _arrays(points: list[float], triangles: list[int]) -> Geometry:
    return (
        np.array(points, dtype=np.float64).reshape(-1, 3),
        np.array(triangles, dtype=np.int64).reshape(-1, 3),
    )


def bad_line(path: Path, number: int, expected: str, line: str) -> MeshFileError:
    """The error of a text file whose line of this number, counted from 1, does not hold what was
    expected."""
    return MeshFileError(
        f"{path}: line {number}: expected {expected}, got {line.strip()[:QUOTED]!a}; correct the "
        "line or export the file again"
    )
