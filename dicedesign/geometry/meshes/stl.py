"""STL files: solids as binary ones, and a reader of these and of ASCII."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError, MeshFileError
from dicedesign.geometry.meshes.body import repeated_positions
from dicedesign.geometry.meshes.text_formats import EXPORT_AGAIN, bad_line
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["STL_HEADER", "STL_TRIANGLE", "parsed_stl", "stl_bytes"]

STL_HEADER: Final = 84
"""Bytes before the first triangle: 80 of any text, then the number of triangles."""

STL_TITLE: Final = b"dicedesign, binary STL, lengths in millimetres".ljust(STL_HEADER - 4)
"""Text at the start of the files that this package writes."""

STL_TRIANGLE: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
"""A triangle of a binary file; its last two bytes are an extension that most programs skip."""


def parsed_stl(data: bytes, path: Path) -> tuple[Floats, Integers]:
    """Points and triangles of the content of an STL file, equal positions made one point again.

    A file is binary when its size is that of the number of triangles it tells, whatever its header
    says (many begin with "solid"). The solids of an ASCII file are joined. Normals and colors are
    skipped.

    path: what to call it in messages. Returns (n, 3) points and (t, 3) triangles.
    Raises MeshFileError: the file is neither, or a `vertex` line of an ASCII file cannot be read.
    """
    count = int.from_bytes(data[STL_HEADER - 4 : STL_HEADER], "little")
    if len(data) == STL_HEADER + count * STL_TRIANGLE.itemsize:
        records = np.frombuffer(data, dtype=STL_TRIANGLE, offset=STL_HEADER)
        points = records["corners"].reshape(-1, 3).astype(np.float64)
    elif data.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and b"\0" not in data:
        points = _ascii_corners(path, data.decode("utf-8", errors="replace"))
    else:
        raise MeshFileError(
            f"{path}: expected a .stl file, text that begins with solid or binary of {STL_HEADER} "
            f"+ {STL_TRIANGLE.itemsize} bytes per triangle, got {len(data)} bytes; {EXPORT_AGAIN}"
        )
    # The format has no shared corners, so joining them repairs nothing worth a note.
    repeated = repeated_positions(points)
    if repeated is None:
        return points, np.arange(len(points)).reshape(-1, 3)
    first, place = repeated
    return points[first], place.reshape(-1, 3)


def _ascii_corners(path: Path, text: str) -> Floats:
    corners: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        keyword, *fields = line.split() or [""]
        if keyword.lower() == "vertex":
            try:
                x, y, z = (float(field) for field in fields)
            except ValueError as error:
                raise bad_line(path, number, "three coordinates", line) from error
            corners.append([x, y, z])
        elif keyword.lower() == "facet" and len(corners) % 3 != 0:
            raise bad_line(path, number, "three corners before the next facet", line)
    if len(corners) % 3 != 0:
        raise MeshFileError(
            f"{path}: expected three corners in every facet, got a file that ends within one; "
            f"{EXPORT_AGAIN}"
        )
    return np.array(corners, dtype=np.float64).reshape(-1, 3)


def stl_bytes(vertices: Floats, triangles: Integers) -> bytes:
    """A triangle mesh as binary STL.

    STL holds float32. Triangles of which two corners round to the same float32 point are left out:
    their two other edges then coincide, so a closed mesh stays closed.

    Parameters
    ----------
    vertices: (n, 3) in mm.
    triangles: (t, 3) in [0, n), counter-clockwise seen from outside.

    Returns
    -------
    bytes, the same for the same mesh. Normals of triangles that round to no area are zero.

    Raises
    ------
    InputError: a coordinate is not finite in float32.
    """
    with np.errstate(over="ignore"):
        points = np.asarray(vertices, dtype=np.float64).astype(np.float32)
    if not np.isfinite(points).all():
        bad = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise InputError(
            f"STL: expected vertices that are finite in float32, got {points[bad].tolist()} in "
            f"row {bad}; repair or scale the solid"
        )
    corners = points[np.asarray(triangles, dtype=np.int64)]
    following = np.roll(corners, -1, axis=1)
    corners = corners[(corners != following).any(axis=2).all(axis=1)]

    a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(len(corners), dtype=STL_TRIANGLE)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records["corners"] = corners
    return STL_TITLE + np.array(len(records), dtype="<u4").tobytes() + records.tobytes()
