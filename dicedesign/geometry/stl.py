"""Reader of STL files, binary and ASCII."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import MeshFileError

__all__ = ["read_stl"]

_HEADER: Final = 84
"""Bytes before the first triangle: 80 of any text, then the number of triangles."""

_TRIANGLE: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])


def read_stl(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points and triangles of an STL file, equal positions made one point again.

    A file is binary when its size is that of the number of triangles it tells, whatever its header
    says (many begin with "solid"). The solids of an ASCII file are joined. Normals and colors are
    skipped.

    Parameters
    ----------
    path : Path
        An existing file.

    Returns
    -------
    points : (n, 3) float
    triangles : (t, 3) int

    Raises
    ------
    MeshFileError
        The file is neither, or a `vertex` line of an ASCII file cannot be read.
    """
    data = path.read_bytes()
    count = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    if len(data) == _HEADER + count * _TRIANGLE.itemsize:
        records = np.frombuffer(data, dtype=_TRIANGLE, offset=_HEADER)
        points = records["corners"].reshape(-1, 3).astype(np.float64)
    elif data.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and b"\0" not in data:
        points = _ascii_corners(path, data.decode("utf-8", errors="replace"))
    else:
        raise MeshFileError(
            f"{path}: cannot be read as a .stl file: expected text that begins with solid or a "
            f"binary file of {_HEADER} + {_TRIANGLE.itemsize} bytes per triangle, got {len(data)} "
            "bytes; export it again as STL, PLY or OBJ"
        )
    # The format has no shared corners, so joining them repairs nothing worth a note.
    positions, corner = np.unique(points, axis=0, return_inverse=True)
    return positions, corner.reshape(-1, 3)


def _ascii_corners(path: Path, text: str) -> NDArray[np.float64]:
    corners: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        keyword, *fields = line.split() or [""]
        if keyword.lower() == "vertex":
            try:
                x, y, z = (float(field) for field in fields)
            except ValueError as error:
                raise _bad_line(path, number, line, "three coordinates") from error
            corners.append([x, y, z])
        elif keyword.lower() == "facet" and len(corners) % 3 != 0:
            raise _bad_line(path, number, line, "three corners before the next facet")
    if len(corners) % 3 != 0:
        raise MeshFileError(
            f"{path}: the file ends within a facet; export it again as STL, PLY or OBJ"
        )
    return np.array(corners, dtype=np.float64).reshape(-1, 3)


def _bad_line(path: Path, number: int, line: str, expected: str) -> MeshFileError:
    return MeshFileError(
        f"{path}: line {number}: expected {expected}, got {line.strip()[:40]!a}; correct the "
        "line or export the file again"
    )
