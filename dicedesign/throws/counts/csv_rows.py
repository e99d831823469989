"""Lines and counts of CSV files that people write."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Final

from dicedesign.errors import InputError

__all__ = ["csv_rows", "require_equal_lengths", "whole_count"]

MOST: Final = 10**9
"""No count is larger."""


def csv_rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The first line of a file of throws, and the lines after it with their numbers; those that are
    empty are left out, and so are the blanks around entries.

    Raises InputError: the file cannot be read.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, [entry.strip() for entry in row]) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(
            f"{path}: expected a CSV file of throws in UTF-8, but {reason}; name such a file"
        ) from error
    (_, first), *others = [(line, row) for line, row in rows if any(row)] or [(1, [])]
    return first, others


def require_equal_lengths(
    path: Path, columns: list[str], rows: list[tuple[int, list[str]]]
) -> None:
    """Raise InputError for a line that has not one entry for each column."""
    for line, row in rows:
        if len(row) != len(columns):
            raise InputError(
                f"{path}, line {line}: expected {len(columns)} entries, got {','.join(row)!r}; "
                "write as many as the first line has"
            )


def whole_count(path: Path, line: int, text: str) -> int:
    """A number of throws. Raises InputError: it is no whole number from 0 to `MOST`."""
    # int() would take "1_000" as well.
    if text.isascii() and text.isdigit() and int(text[:20]) <= MOST:
        return int(text)
    raise InputError(
        f"{path}, line {line}: expected a whole number from 0 to {MOST}, got {text!r}; correct the "
        "count"
    )
