"""Mesh files of tests."""

from __future__ import annotations

from pathlib import Path

from dicedesign.fabricate.file_formats import mesh_bytes
from dicedesign.runtime.arrays import Floats, Integers


def write_mesh(path: Path, points: Floats, triangles: Integers) -> None:
    """Write a closed mesh in the format of the path's ending."""
    path.write_bytes(mesh_bytes(points, triangles, path.suffix))
