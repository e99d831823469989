"""What the readers of mesh files say when a file is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from dicedesign.errors import MeshFileError

__all__ = ["EXPORT_AGAIN", "bad_line"]

EXPORT_AGAIN: Final = "export it again as STL, PLY or OBJ"
"""The remedy for a file that is wrong as a whole."""

_QUOTED: Final = 40
"""Characters of a wrong line that are quoted."""


def bad_line(path: Path, number: int, expected: str, line: str) -> MeshFileError:
    """The error of a text file whose line of this number, counted from 1, does not hold what was
    expected."""
    return MeshFileError(
        f"{path}: line {number}: expected {expected}, got {line.strip()[:_QUOTED]!a}; correct the "
        "line or export the file again"
    )
