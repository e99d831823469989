"""Files that are written whole or not at all, and JSON as all of them have it."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from pathlib import Path

from dicedesign.errors import OutputError

__all__ = ["atomic_write", "json_text", "make_writable_folder"]


def json_text(plain: object) -> str:
    """Plain data as JSON for people, with a line feed at its end. Raises ValueError: a number is
    not finite."""
    return json.dumps(plain, indent=1, allow_nan=False) + "\n"


def atomic_write(path: Path, data: bytes) -> None:
    """Write a file so that its path holds the old content or all of the new.

    Parameters
    ----------
    path: the file, in an existing folder.
    data: its content.

    Raises
    ------
    OutputError: the file cannot be written; nothing is left behind.
    """
    path = Path(path)
    partial = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        with partial.open("xb") as file:
            file.write(data)
        os.replace(partial, path)
    except OSError as error:
        raise OutputError(
            f"{path}: expected to write a file in an existing, writable folder with space left, "
            f"got {str(error.strerror or error)!r}; create the folder or choose another path"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()


def make_writable_folder(folder: Path) -> None:
    """Make a folder for results if it is missing, and try whether files can be made in it.

    Raises
    ------
    OutputError: it cannot be made or written.
    """
    probe = folder / f".{secrets.token_hex(8)}.part"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"{folder}: expected a folder that can be written, got {error.strerror!r}; choose "
            "another with --out"
        ) from error
