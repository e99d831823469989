"""The table of a folder of meshes: a row for each rest, kept in a CSV file."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.files import atomic_write
from dicedesign.rest.poses import RestPoses

__all__ = ["COLUMNS", "Entry", "Stamp", "Table", "analysed_entry", "broken_entry"]

PER_REST: Final = (
    "rest",
    "probability",
    "normal_x",
    "normal_y",
    "normal_z",
    "area",
    "margin_deg",
)
"""Columns of one rest; rests are numbered from 1, the most probable first."""

STAMPED: Final = ("bytes", "modified_ns", "com", "coplanar_tolerance")
"""Columns that tell whether rows are still those of the file and of the options."""

COLUMNS: Final = (
    "file",
    *PER_REST,
    "rests",
    "center_of_mass_x",
    "center_of_mass_y",
    "center_of_mass_z",
    "center_of_mass_source",
    "hull_vertices",
    "seconds",
    "notes",
    "error",
    *STAMPED,
)
"""Of the table. Lengths are in the mesh's unit; those after `PER_REST` are of the file."""

INTERVAL: Final = 5.0
"""Seconds after which what is new is written."""

SHARE: Final = 0.02
"""Of the time, at most so much goes into writing the table before the end."""


@dataclass(frozen=True)
class Stamp:
    """What a file was when it was analysed, and what was asked about it.

    Attributes
    ----------
    size: of the file, in bytes.
    modified: time of its last change, in nanoseconds since 1970.
    com, coplanar_tolerance: the options as text, empty where they were left out.
    """

    size: int
    modified: int
    com: str = ""
    coplanar_tolerance: str = ""


@dataclass(frozen=True)
class Entry:
    """The rows of one file.

    Attributes
    ----------
    stamp: see `Stamp`.
    text: the rows as CSV.
    rests: their number; 0 for a file that could not be analysed.
    """

    stamp: Stamp
    text: str
    rests: int


def analysed_entry(file: str, stamp: Stamp, poses: RestPoses, seconds: float) -> Entry:
    """The rows of a file's rests; `seconds` were spent on reading and analysing it."""
    count = len(poses.probabilities)
    whole = [
        count,
        *poses.center_of_mass.tolist(),
        poses.center_of_mass_source,
        len(poses.hull.vertices),
        f"{seconds:.6f}",
        " | ".join(poses.notes),
        "",
    ]
    numbers = np.column_stack(
        [poses.probabilities, poses.normals, poses.areas, np.degrees(poses.margins)]
    )
    each = [[file, rest, *row, *whole] for rest, row in enumerate((numbers + 0.0).tolist(), 1)]
    return _entry(stamp, each, count)


def broken_entry(file: str, stamp: Stamp, error: str, seconds: float = 0.0) -> Entry:
    """The row of a file that could not be analysed, with the reason in one line."""
    nothing = [""] * (len(COLUMNS) - len(STAMPED) - 3)
    nothing[COLUMNS.index("rests") - 1] = "0"
    nothing[COLUMNS.index("seconds") - 1] = f"{seconds:.6f}"
    return _entry(stamp, [[file, *nothing, "", " ".join(error.split())]], 0)


def _entry(stamp: Stamp, rows: list[list[object]] | list[list[str]], rests: int) -> Entry:
    tail = [stamp.size, stamp.modified, stamp.com, stamp.coplanar_tolerance]
    return Entry(stamp, _csv([*row, *tail] for row in rows), rests)


def _csv(rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


class Table:
    """Entries by file name, kept in a CSV file: at intervals, and when the context ends, however
    it does. The file holds whole entries only, in the order of their names."""

    def __init__(self, path: Path, entries: Mapping[str, Entry]) -> None:
        """Writes the file, so that one that cannot be written is noticed at once.

        Raises OutputError.
        """
        self.path = path
        self.entries = dict(entries)
        self._new = True
        self._due = 0.0
        self.save()

    @staticmethod
    def read(path: Path) -> dict[str, Entry]:
        """The entries of a table that an earlier run left; none where there is no file.

        Raises InputError: the file is no such table.
        """
        try:
            text = path.read_bytes().decode("utf-8", "surrogateescape")
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise InputError(
                f"{path}: expected a readable table, got {error.strerror!r}; check path and "
                "permissions"
            ) from error
        try:
            return _entries(text)
        except (ValueError, csv.Error) as error:
            raise InputError(
                f"{path}: expected a table of an earlier run or no file, but {error}; choose "
                "another with --out"
            ) from error

    def add(self, entries: Mapping[str, Entry]) -> None:
        """Take entries in, and write the table if that is due. Raises OutputError."""
        self.entries.update(entries)
        self._new = True
        if time.monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Write the table if there is anything new. Raises OutputError."""
        if not self._new:
            return
        started = time.monotonic()
        texts = [self.entries[file].text for file in sorted(self.entries)]
        data = "".join([_csv([COLUMNS]), *texts]).encode("utf-8", "surrogateescape")
        atomic_write(self.path, data)
        ended = time.monotonic()
        self._new = False
        self._due = ended + max(INTERVAL, (ended - started) / SHARE)

    def __enter__(self) -> Table:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.save()


def _entries(text: str) -> dict[str, Entry]:
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    if tuple(next(rows, ())) != COLUMNS:
        raise ValueError("its columns are others")
    of_file: dict[str, list[list[str]]] = {}
    for row in rows:
        if len(row) != len(COLUMNS):
            raise ValueError(f"line {rows.line_num} has {len(row)} columns of {len(COLUMNS)}")
        of_file.setdefault(row[0], []).append(row)
    entries = {}
    for file, own in of_file.items():
        last = dict(zip(COLUMNS, own[-1], strict=True))
        size, modified, com, tolerance = (last[name] for name in STAMPED)
        stamp, rests = Stamp(int(size), int(modified), com, tolerance), int(last["rests"])
        # A file whose rows are not all there is analysed again.
        if len(own) == max(rests, 1):
            entries[file] = Entry(stamp, _csv(own), rests)
    return entries
