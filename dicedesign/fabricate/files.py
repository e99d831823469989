"""Write results to disk, whole or not at all, and solids as binary STL."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError, OutputError

__all__ = ["atomic_write", "stl_bytes", "write_stl"]

_HEADER: Final = b"dicedesign, binary STL, lengths in millimetres".ljust(80)
_RECORD: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])


def atomic_write(path: Path, data: bytes) -> None:
    """Write a file so that its path holds the old content or all of the new.

    Parameters
    ----------
    path : the file, in an existing folder.
    data : its content.

    Raises
    ------
    OutputError : the file cannot be written; nothing is left behind.
    """
    path = Path(path)
    partial = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        with partial.open("xb") as file:
            file.write(data)
        os.replace(partial, path)
    except OSError as error:
        raise OutputError(
            f"cannot write {path} ({error.strerror or error}); expected a file in an existing, "
            "writable folder with space left. Create the folder or choose another path."
        ) from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()


def stl_bytes(vertices: np.ndarray, triangles: np.ndarray) -> bytes:
    """A triangle mesh as binary STL.

    STL holds float32. Triangles of which two corners round to the same float32 point are left out:
    their two other edges then coincide, so a closed mesh stays closed.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    triangles : (t, 3) int in [0, n), counter-clockwise seen from outside.

    Returns
    -------
    bytes, the same for the same mesh. Normals of triangles that round to no area are zero.

    Raises
    ------
    InputError : a coordinate is not finite in float32.
    """
    with np.errstate(over="ignore"):
        points = np.asarray(vertices, dtype=np.float64).astype(np.float32)
    if not np.isfinite(points).all():
        raise InputError("vertices for STL must be finite in float32, got one that is not.")
    corners = points[np.asarray(triangles, dtype=np.int64)]
    following = np.roll(corners, -1, axis=1)
    corners = corners[(corners != following).any(axis=2).all(axis=1)]

    a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(len(corners), dtype=_RECORD)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records["corners"] = corners
    return _HEADER + np.array(len(records), dtype="<u4").tobytes() + records.tobytes()


def write_stl(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Write a triangle mesh as binary STL; see `stl_bytes` and `atomic_write`."""
    atomic_write(path, stl_bytes(vertices, triangles))
