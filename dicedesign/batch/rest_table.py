"""The table of a folder of meshes, kept in a file."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from dicedesign.batch.formats import table_format
from dicedesign.batch.rows import COLUMNS, Entry, csv_line, entries_of
from dicedesign.errors import InputError
from dicedesign.runtime.checkpoint import KeptFile
from dicedesign.runtime.files import read_file

__all__ = ["RestTable"]


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
        self._file = KeptFile(path, "a table", self._content)
        self._file.change()

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
        self._file.change()

    def save(self) -> None:
        """Write the table if there is anything new.

        Raises OutputError: that cannot be done, or another run has written the table meanwhile.
        """
        self._file.save()

    def _content(self) -> bytes:
        texts = [self.entries[file].text for file in sorted(self.entries)]
        return self._format.encode("".join([csv_line(COLUMNS), *texts]))

    def __enter__(self) -> RestTable:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.save()
