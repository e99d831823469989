"""Solids as binary STL."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.geometry.stl import STL_TRIANGLE

__all__ = ["stl_bytes"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_TITLE: Final = b"dicedesign, binary STL, lengths in millimetres".ljust(80)


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
    return _TITLE + np.array(len(records), dtype="<u4").tobytes() + records.tobytes()
