"""The table of a folder of meshes, kept in a file."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Final

from dicedesign.batch.formats import table_format
from dicedesign.batch.rows import COLUMNS, Entry, csv_line, entries_of
from dicedesign.errors import InputError, OutputError
from dicedesign.runtime.files import atomic_write, read_file

__all__ = ["RestTable"]

INTERVAL: Final = 5.0
"""Seconds after which what is new is written."""

SHARE: Final = 0.02
"""Of the time, at most so much goes into writing the table before the end."""


class RestTable:
    """Entries by file name, kept in a file: at intervals, and when the context ends, however it
    does.

    The file is CSV or Parquet, as its ending says, and is replaced as a whole, so that at any time
    it holds whole entries only, in the order of their names. Nothing else is kept beside it: what
    a run goes on from is the table itself.
    """

    def __init__(self, path: Path, entries: Mapping[str, Entry]) -> None:
        """Writes the file, so that one that cannot be written is noticed at once.

        Raises OutputError; InputError as `table_format`.
        """
        self.path = path
        self.entries = dict(entries)
        self._format = table_format(path)
        self._written = _state(path)
        self._new = True
        self._due = 0.0
        self.save()

    @staticmethod
    def read(path: Path) -> dict[str, Entry]:
        """The entries of a table that an earlier run left; none where there is no file.

        Raises InputError: the file is no such table, or as `table_format`.
        """
        decode = table_format(path).decode
        if not os.path.lexists(path):
            return {}
        data = read_file(path, "a table of an earlier run")
        try:
            return entries_of(decode(data))
        except (ValueError, csv.Error) as error:
            raise InputError(
                f"{path}: expected a table of an earlier run or no file, but "
                f"{' '.join(str(error).split())}; choose another with --out"
            ) from error

    def add(self, entries: Mapping[str, Entry]) -> None:
        """Take entries in, and write the table if that is due. Raises OutputError."""
        self.entries.update(entries)
        self._new = True
        if time.monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Write the table if there is anything new.

        Raises OutputError: that cannot be done, or another run has written the table meanwhile.
        """
        if not self._new:
            return
        started = time.monotonic()
        texts = [self.entries[file].text for file in sorted(self.entries)]
        data = self._format.encode("".join([csv_line(COLUMNS), *texts]))
        if _state(self.path) not in (None, self._written):
            raise OutputError(
                f"{self.path}: expected a table that only this run writes, but another one has "
                "written it meanwhile; let that one end, then run the same command to go on"
            )
        atomic_write(self.path, data)
        self._written = _state(self.path)
        ended = time.monotonic()
        self._new = False
        self._due = ended + max(INTERVAL, (ended - started) / SHARE)

    def __enter__(self) -> RestTable:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.save()


def _state(path: Path) -> tuple[int, int] | None:
    """Size and time of the last change of a file; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns
