"""A file that keeps what a process has done so far, from which the next one goes on."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from dicedesign.errors import OutputError
from dicedesign.runtime.files import atomic_write, remove_partial_files

__all__ = ["KeptFile"]

INTERVAL: Final = 5.0
"""Seconds after which what is new is written."""

SHARE: Final = 0.02
"""Of the time, at most so much goes into writing the file before the end."""


class KeptFile:
    """A file that one process writes, again and again as a whole: at any time it holds the old
    content or all of the new."""

    def __init__(self, path: Path, kind: str, content: Callable[[], bytes]) -> None:
        """kind: what it is, for messages, such as "a table"; content: makes what is to be written.
        Nothing is written yet, but what a killed process left half written is removed."""
        remove_partial_files(path.parent, path.name)
        self.path = path
        self._kind = kind
        self._content = content
        self._new = False
        self._written = _state(path)
        self._due = 0.0

    @property
    def is_due(self) -> bool:
        """Whether it was not written for so long that what is new should be."""
        return time.monotonic() >= self._due

    def change(self) -> None:
        """Take note that the content is new, and write it if that is due. Raises OutputError: as
        `save`."""
        self._new = True
        if self.is_due:
            self.save()

    def save(self) -> None:
        """Write the content if it is new.

        Raises OutputError: that cannot be done, or another process has written the file meanwhile.
        """
        if not self._new:
            return
        started = time.monotonic()
        data = self._content()
        if _state(self.path) not in (None, self._written):
            raise OutputError(
                f"{self.path}: expected {self._kind} that only this run writes, but another one "
                "has written it meanwhile; let that one end, then run the same command to go on"
            )
        atomic_write(self.path, data)
        self._written = _state(self.path)
        self._new = False
        ended = time.monotonic()
        self._due = ended + max(INTERVAL, (ended - started) / SHARE)

    def remove(self) -> None:
        """Remove it if it is there. Raises OutputError: that cannot be done."""
        try:
            self.path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{self.path}: expected a file that can be removed, got {error.strerror!r}; remove "
                "it"
            ) from error


def _state(path: Path) -> tuple[int, int] | None:
    """Size and time of the last change of a file; None where there is none."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns
