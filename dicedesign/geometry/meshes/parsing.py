"""Parsers of mesh and point files: STL, OBJ, OFF, XYZ and PLY, positions and faces, nothing else.

They take polygons of any size, relative OBJ indices, comments and any separator, and name the line
of an error.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import MeshFileError
from dicedesign.geometry.meshes.body import merge_positions
from dicedesign.runtime.arrays import Floats, Integers


class Geometry(NamedTuple):
    """Content of a mesh file.

    Attributes
    ----------
    points: (n, 3); triangles: (t, 3) zero-based, t = 0 for a point cloud, not yet checked against
        n.
    notes: what was left out or joined, one sentence each.
    is_rounded: whether the coordinates were, see `body.is_rounded`; None to look at the points.
    """

    points: Floats
    triangles: Integers
    notes: tuple[str, ...] = ()
    is_rounded: bool | None = None


Line = tuple[int, list[str]]

EXPORT_AGAIN = "export it again as STL, PLY or OBJ"
"""The remedy for a file that is wrong as a whole."""

QUOTED = 40
"""Characters of a wrong line that are quoted."""

MOST_INDEX = 2**31
"""Largest vertex number."""

MAX_TEXT_BYTES = 1 << 30
"""Limit of a mesh or point file that is text: 1 GiB, which takes ten times as much memory."""

DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+")
"""A number with a comma for its point."""


def parse_obj(data: bytes, path: Path) -> Geometry:
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
    for number, fields in _lines(_decode(data, path)):
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


OFF_HEADER = re.compile(r"(?:ST)?C?N?(4)?OFF", re.IGNORECASE)
"""First word of an OFF file; some programs write the counts directly after it."""

OFF_EXTRAS = {"S": 2, "C": 4, "N": 3}
"""Numbers after the position of a vertex, by a letter before OFF: texture, color, normal."""


def parse_off(data: bytes, path: Path) -> Geometry:
    """Positions and fan-triangulated faces of an ASCII OFF file, colored or not.

    A line for each vertex and face may end with colors; otherwise the file is a stream of numbers
    with any line breaks. Parameters, results and errors are those of `parse_obj`.
    """
    lines = list(_lines(_decode(data, path)))
    header = OFF_HEADER.match(lines[0][1][0]) if lines else None
    if header is None:
        raise MeshFileError(
            f"{path}: expected an ASCII OFF file, whose first word is OFF, got another; "
            f"{EXPORT_AGAIN}"
        )
    number, first = lines[0]
    first = [first[0][header.end() :], *first[1:]]
    lines[0] = (number, first if first[0] else first[1:])
    if not lines[0][1]:
        del lines[0]
    size = 4 if header[1] else 3
    try:
        return _parse_off_lines(lines, size, path)
    except MeshFileError as error:
        width = size + sum(OFF_EXTRAS.get(letter, 0) for letter in header[0].upper()[:-3])
        try:
            return _parse_off_lines(_regroup_off(lines, width), size, path)
        except (MeshFileError, LookupError, ValueError):
            raise error from None


def _regroup_off(lines: list[Line], width: int) -> list[Line]:
    """Lines of the counts, each vertex and each face of an OFF file with other line breaks.

    width: numbers of a vertex. Raises LookupError or ValueError for other content.
    """
    words = [(number, field) for number, fields in lines for field in fields]
    points, faces = int(words[0][1]), int(words[1][1])
    if min(points, faces) < 0 or width * points + faces > len(words):
        raise ValueError
    starts = [0, *range(3, 3 + width * points + 1, width)]
    for _ in range(faces):
        sides = int(words[starts[-1]][1])
        if sides < 0:
            raise ValueError
        starts.append(starts[-1] + 1 + sides)
    if starts[-1] != len(words):
        raise ValueError
    return [(words[a][0], [field for _, field in words[a:b]]) for a, b in pairwise(starts)]


def _parse_off_lines(lines: list[Line], size: int, path: Path) -> Geometry:
    """Geometry of the lines of an OFF file after its header, with positions of 3 numbers or 4,
    homogeneous ones."""
    counts = _integers(path, lines[0][0], lines[0][1][:2]) if lines else []
    if len(counts) != 2 or min(counts) < 0 or len(lines) - 1 != sum(counts):
        raise MeshFileError(
            f"{path}: expected the numbers of vertices and faces and then as many lines, got "
            f"{counts} and {max(len(lines) - 1, 0)} lines; export the file again"
        )
    rows, faces = lines[1 : 1 + counts[0]], lines[1 + counts[0] :]
    points: list[float] = []
    for number, fields in rows:
        position = _position(path, number, fields[:3])
        if size == 4:
            (weight, _, _) = _position(path, number, [*fields[3:4], "0", "0"])
            if weight == 0.0:
                raise bad_line(path, number, "a point at a finite distance", " ".join(fields))
            position = tuple(x / weight for x in position)
        points += position
    triangles: list[int] = []
    for number, fields in faces:
        (sides,) = _integers(path, number, fields[:1])
        polygon = _integers(path, number, fields[1 : 1 + sides])
        if len(polygon) != sides:
            raise bad_line(path, number, f"{sides} vertex numbers", " ".join(fields))
        triangles += _fan(path, number, fields, polygon)
    return _arrays(points, triangles)


def parse_xyz(data: bytes, path: Path) -> Geometry:
    """Points of a text file, the first three numbers of every line; further columns are skipped.

    Parameters, results and errors are those of `parse_obj`, without triangles.
    """
    points: list[float] = []
    for number, words in _lines(_decode(data, path)):
        if len(words) >= 3 and all(DECIMAL_COMMA.fullmatch(word) for word in words[:3]):
            raise bad_line(path, number, "decimal points", " ".join(words))
        fields = " ".join(words).replace(",", " ").replace(";", " ").split()
        points += _position(path, number, fields[:3])
    return _arrays(points, [])


def _decode(data: bytes, path: Path) -> str:
    """Text in UTF-8, UTF-16 or UTF-32, with or without a byte order mark. Raises MeshFileError if
    it is too long."""
    if len(data) > MAX_TEXT_BYTES:
        raise MeshFileError(
            f"{path}: expected a text of at most {MAX_TEXT_BYTES >> 20} MiB, got "
            f"{len(data) >> 20}; export it as binary STL or PLY"
        )
    # The first characters are ASCII, as in JSON.
    return data.decode(json.detect_encoding(data), errors="replace").removeprefix("\ufeff")


def _lines(text: str) -> Iterator[Line]:
    """Number and fields of every line that holds any, comments and continuations resolved."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    pending, start = list[str](), 0
    for number, line in enumerate(lines, start=1):
        start = start or number
        if "#" in line:
            line = line.partition("#")[0]
        line = line.rstrip()
        if line.endswith("\\"):
            pending.append(line[:-1])
            continue
        if fields := "".join([*pending, line]).split():
            yield start, fields
        pending.clear()
        start = 0


def _position(path: Path, number: int, fields: Sequence[str]) -> tuple[float, ...]:
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
    """Corners of the triangles of a polygon's fan, one after the other."""
    if len(polygon) == 3:
        return polygon
    if len(polygon) < 3:
        raise bad_line(path, number, "a face of at least 3 vertices", " ".join(fields))
    return [i for b, c in pairwise(polygon[1:]) for i in (polygon[0], b, c)]


def fans(sizes: Integers, corners: Integers) -> Integers:
    """Triangles (t, 3) of the fans of polygons of sizes (n,), whose corners are one after the
    other. Raises ValueError for polygons of fewer than 3 corners."""
    if (sizes < 3).any():
        raise ValueError
    polygon = np.repeat(np.arange(len(sizes)), sizes - 2)
    first = (np.cumsum(sizes) - sizes)[polygon]
    number = np.arange(len(polygon)) - (np.cumsum(sizes - 2) - sizes + 2)[polygon]
    places = first[:, None] + np.stack([0 * number, number + 1, number + 2], axis=1)
    return corners.astype(np.int64)[places]


def _arrays(points: list[float], triangles: list[int]) -> Geometry:
    return Geometry(
        np.array(points, dtype=np.float64).reshape(-1, 3),
        np.array(triangles, dtype=np.int64).reshape(-1, 3),
    )


def bad_line(path: Path, number: int, expected: str, line: str) -> MeshFileError:
    """Error about a line of a text file, numbered from 1, that does not hold what was expected."""
    return MeshFileError(
        f"{path}: line {number}: expected {expected}, got {line.strip()[:QUOTED]!a}; correct the "
        "line or export the file again"
    )


PLY_TYPES = {
    name: code
    for code, names in {
        "i1": "char int8",
        "u1": "uchar uint8",
        "i2": "short int16",
        "u2": "ushort uint16",
        "i4": "int int32",
        "u4": "uint uint32",
        "f4": "float float32",
        "f8": "double float64",
    }.items()
    for name in names.split()
}
"""NumPy's codes of the types of PLY."""

PLY_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""Byte orders of the formats of PLY."""

PLY_FACES = {"vertex_indices", "vertex_index"}
"""Names of the corners of faces."""

PLY_START = re.compile(rb"\s*ply[^\S\r\n]*(?=(\r\n|\r|\n))")

MAX_HEADER_BYTES = 1 << 16
"""Limit of the header of a PLY file: 64 KiB."""

MAX_WORD_BYTES = 64
"""Limit of a word in a PLY file that is text; an array has the longest for all of them."""


class PlyElement(NamedTuple):
    """Name and number of the elements of one kind, and the name, type and, of a list, type of the
    length of each property."""

    name: str
    number: int
    properties: list[tuple[str, str, str]]


def parse_ply(data: bytes, path: Path) -> Geometry:
    """Positions and fan-triangulated faces of a PLY file, text or binary.

    Parameters and results are those of `parse_obj`. Raises MeshFileError: its header promises other
    content than there is, or ValueError, LookupError or TypeError: it is none.
    """
    start = PLY_START.match(data, 0, MAX_HEADER_BYTES)
    if start is None:
        raise ValueError
    end = re.compile(rb"\send_header[ \t]*" + start[1])
    header = end.search(data, start.end(), MAX_HEADER_BYTES)
    if header is None:
        raise ValueError
    elements: list[PlyElement] = []
    order = ""
    for words in map(str.split, data[: header.end()].decode("latin-1").splitlines()):
        if words[:1] == ["format"]:
            order = PLY_ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(PlyElement(words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            length = PLY_TYPES[words[2]] if words[1] == "list" else ""
            elements[-1].properties.append((words[-1], PLY_TYPES[words[-2]], length))
    body: NDArray[Any]
    if order:
        body = np.frombuffer(data, np.uint8, offset=header.end())
    else:
        fields = data[header.end() :].split()
        if max(map(len, fields), default=0) > MAX_WORD_BYTES or len(data) > MAX_TEXT_BYTES:
            raise ValueError
        body = np.array(fields, dtype=np.bytes_)
    points, triangles, at = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), 0
    try:
        for element in elements:
            columns, at = _ply_columns(element, body, at, order)
            if element.name == "vertex":
                points = np.stack([columns[axis][1] for axis in "xyz"], axis=1).astype(np.float64)
            elif element.name == "face" and element.number:
                triangles = fans(*columns[next(iter(columns.keys() & PLY_FACES))])
        if body[at:].tobytes().strip(b"\0\r\n "):
            raise ValueError
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        counts = ", ".join(f"{element.number} {element.name}" for element in elements)
        raise MeshFileError(
            f"{path}: expected a .ply file of what its header promises, {counts}, got other "
            f"content; {EXPORT_AGAIN}"
        ) from error
    return Geometry(points, triangles)


def _ply_columns(
    element: PlyElement, body: NDArray[Any], at: int, order: str
) -> tuple[dict[str, tuple[Integers, NDArray[Any]]], int]:
    """Lengths (n,) and values of each property of elements, and the place after them in the body,
    (b,) bytes or, in a text, words."""

    def size(code: str) -> int:
        return np.dtype(code).itemsize if order else 1

    def take(rows: NDArray[Any], start: int, count: int, code: str) -> NDArray[Any]:
        part = rows[:, start : start + count * size(code)]
        if order:
            return np.ascontiguousarray(part).view(order + code)
        return part.astype(np.float64 if code[0] == "f" else np.int64)

    lengths: dict[str, list[Integers]] = {name: [] for name, _, _ in element.properties}
    values: dict[str, list[NDArray[Any]]] = {name: [] for name, _, _ in element.properties}
    done, ahead = 0, 1
    while done < element.number and lengths:
        # Rows with lists as long as in the first of them are read together.
        width, places = 0, []
        for name, code, of_length in element.properties:
            count = 1
            if of_length:
                count = int(take(body[None, at:], width, 1, of_length)[0, 0])
                places.append(("", width, count, of_length))
                width += size(of_length)
            places.append((name, width, count, code))
            width += count * size(code)
        number = min(ahead, element.number - done, (len(body) - at) // width)
        rows = body[at : at + number * width].reshape(number, width)
        equal = np.ones(number, dtype=bool)
        for name, start, count, code in places:
            if not name:
                equal &= take(rows, start, 1, code)[:, 0] == count
        number = number if equal.all() else int(equal.argmin())
        if number == 0:
            raise ValueError
        for name, start, count, code in places:
            if name:
                lengths[name].append(np.full(number, count))
                values[name].append(take(rows[:number], start, count, code).ravel())
        at, done, ahead = at + number * width, done + number, 2 * number
    columns = {
        name: (np.concatenate(lengths[name]), np.concatenate(values[name]))
        for name in lengths
        if element.number > 0
    }
    return columns, at


STL_HEADER = 84
"""Bytes before the first triangle: 80 of any text, then the number of triangles."""

STL_TITLE = b"dicedesign, binary STL, lengths in millimeters".ljust(STL_HEADER - 4)
"""Text at the start of the files that this package writes."""

STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
"""Triangle of a binary file; its last two bytes are an extension that most programs skip."""


STL_TEXT = re.compile(r"^[^\S\n]*(solid|facet)\b", re.IGNORECASE | re.MULTILINE)
"""A line of an STL file that is text."""


def parse_stl(data: bytes, path: Path) -> Geometry:
    """Points and triangles of an STL file, with equal positions merged into one point.

    A file is binary when it has the number of triangles that its header says, whatever else the
    header says (many begin with "solid"). Bytes after them are ignored with a note. The solids of a
    text are joined, and lines of other content skipped. So are normals and colors.

    path: what to call it in messages.
    Raises MeshFileError: the file is neither, or a `vertex` line of a text cannot be read.
    """
    count = int.from_bytes(data[STL_HEADER - 4 : STL_HEADER], "little")
    size = STL_HEADER + count * STL_TRIANGLE.itemsize
    more = data[size:] if STL_HEADER <= size <= len(data) else b""
    notes: tuple[str, ...] = ()
    # As many bytes as a triangle has may be triangles beyond a wrong count.
    is_cut = len(more) % STL_TRIANGLE.itemsize == 0 and more.strip(b"\0") != b""
    if len(data) == size or (count > 0 and more and not is_cut):
        records = np.frombuffer(data, STL_TRIANGLE, count, STL_HEADER)
        points = records["corners"].reshape(-1, 3).astype(np.float64)
        if more:
            notes = (f"ignored {len(more)} bytes after the last triangle",)
    else:
        text = _decode(data, path)
        if is_cut or "\0" in text or not STL_TEXT.search(text):
            raise MeshFileError(
                f"{path}: expected a .stl file, text of solids or binary of {STL_HEADER} "
                f"+ {STL_TRIANGLE.itemsize} bytes for each of {count} triangles, got {len(data)} "
                f"bytes; {EXPORT_AGAIN}"
            )
        corners: list[float] = []
        for number, (keyword, *fields) in _lines(text):
            if keyword.lower() == "vertex":
                corners += _position(path, number, fields)
            elif keyword.lower() == "facet" and len(corners) % 9 != 0:
                expected = "three corners before the next facet"
                raise bad_line(path, number, expected, " ".join([keyword, *fields]))
        if len(corners) % 9 != 0:
            raise MeshFileError(
                f"{path}: expected three corners in every facet, got a file that ends within one; "
                f"{EXPORT_AGAIN}"
            )
        points = np.array(corners, dtype=np.float64).reshape(-1, 3)
    # The format has no shared corners, so joining them repairs nothing worth a note.
    first, place = merge_positions(points)
    return Geometry(points[first], place.reshape(-1, 3), notes)
