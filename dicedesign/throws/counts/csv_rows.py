"""Lines and counts of CSV files that people write."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Final

from dicedesign.errors import InputError

__all__ = ["MOST", "csv_rows", "whole_count"]

MOST: Final = 10**9
"""No count is larger."""


def csv_rows(path: Path) -> list[tuple[int, list[str]]]:
    """The lines of a file of throws that are not empty, with their numbers; entries without the
    blanks around them. Raises InputError: the file cannot be read."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, [entry.strip() for entry in row]) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(
            f"{path}: expected a CSV file of throws in UTF-8, but {reason}; name such a file"
        ) from error
    return [(line, row) for line, row in rows if any(row)]


def whole_count(text: str) -> int | None:
    """The whole number from 0 to `MOST` that a text is, or None."""
    # int() would take "1_000" as well.
    if text.isascii() and text.isdigit() and int(text[:20]) <= MOST:
        return int(text)
    return None
