"""Lines and counts of CSV files that people write."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Final

from dicedesign.errors import InputError
from dicedesign.runtime.files import read_text

__all__ = ["csv_rows", "require_equal_lengths", "whole_count"]

MOST: Final = 10**9
"""No count is larger."""

QUOTED: Final = 40
"""Characters of a wrong entry that are quoted."""


def csv_rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The first line of a file of throws, and the lines after it with their numbers; those that are
    empty are left out, and so are the blanks around entries.

    Raises InputError: the file cannot be read.
    """
    text = read_text(path, "a CSV file of throws")
    try:
        reader = csv.reader(io.StringIO(text, newline=""))
        rows = [(reader.line_num, [entry.strip() for entry in row]) for row in reader]
    except csv.Error as error:
        raise InputError(
            f"{path}: expected a CSV file of throws, but {error}; correct it"
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
    # int() would take "1_000" as well, and take long over thousands of digits.
    digits = text.lstrip("0") or text
    if text.isascii() and text.isdigit() and len(digits) <= QUOTED and int(digits) <= MOST:
        return int(digits)
    raise InputError(
        f"{path}, line {line}: expected a whole number from 0 to {MOST}, got {text[:QUOTED]!r}; "
        "correct the count"
    )
