"""A folder that one process alone writes into."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from dicedesign.errors import InputError, OutputError

__all__ = ["locked_folder"]

LOCK: Final = ".lock"
"""There while somebody writes into the folder; says who. Beyond the end of its holder, however that
came, it locks nothing."""


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Nobody else comes in here with the same folder, an existing one, meanwhile.

    Raises
    ------
    InputError: somebody is here already; the message says which process on which machine.
    OutputError: the lock cannot be written.
    """
    try:
        import fcntl
    except ImportError:
        # Windows.
        yield
        return
    path = folder / LOCK
    handle = _opened(path)
    try:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                holder = os.read(handle, 100).decode("utf-8", "replace") or "another process"
                raise InputError(
                    f"{folder}: expected a folder that nobody else writes into, but {holder} does; "
                    "wait for it, or choose another folder with --out"
                ) from error
            if _is_at(handle, path):
                break
            # Its last holder has removed it meanwhile.
            os.close(handle)
            handle = _opened(path)
        os.truncate(handle, 0)
        os.write(handle, f"process {os.getpid()} on {socket.gethostname()}".encode())
        try:
            yield
        finally:
            path.unlink(missing_ok=True)
    finally:
        os.close(handle)


def _opened(path: Path) -> int:
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise OutputError(
            f"{path}: expected a file that can be written, got {error.strerror!r}; choose another "
            "folder with --out"
        ) from error


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False
