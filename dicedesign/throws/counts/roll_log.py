"""Files of a die's throws."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Integers
from dicedesign.throws.counts.csv_rows import MOST, csv_rows, whole_count

__all__ = ["read_counts"]

COUNTED: Final = ["label", "count"]

ONE_BY_ONE: Final = ["label"]
"""The two headers that a file may have."""

MOST_NAMED: Final = 30
"""Labels that an error names."""

Rows = list[tuple[int, list[str]]]


def read_counts(path: Path, labels: Sequence[str]) -> Integers:
    """How often each of k distinct labels came up (k,), from a CSV file.

    The file has the columns label and count, each label at most once, those that never came up
    perhaps not at all; or only the column label, with one throw on each line. Empty lines and
    blanks around entries are ignored.

    Raises
    ------
    InputError: the file cannot be read or has other columns, an unknown label, a label twice, a
        count that is not a whole number of at least 0, or no throw.
    """
    (_, first), *rows = csv_rows(path) or [(1, [])]
    header = [entry.lower() for entry in first]
    if header not in (COUNTED, ONE_BY_ONE):
        raise InputError(
            f"{path}: expected a first line label,count or label, got {','.join(first)!r}; "
            "begin with label,count and write each label with its count on a line, or with label "
            "and write the label of each throw on a line"
        )
    for line, row in rows:
        if len(row) != len(header):
            raise InputError(
                f"{path}, line {line}: expected {','.join(header)}, got {','.join(row)!r}; "
                "write as many entries as the first line has"
            )
        if row[0] not in labels:
            some = ", ".join(labels[:MOST_NAMED]) + ", ..." * (len(labels) > MOST_NAMED)
            raise InputError(
                f"{path}, line {line}: expected a label of the die ({some}), got {row[0]!r}; "
                "correct it, or leave out throws that show no label"
            )
    counts = _counts(path, rows) if header == COUNTED else [(row[0], 1) for _, row in rows]
    sums = dict.fromkeys(labels, 0)
    for label, count in counts:
        sums[label] += count
    if not any(sums.values()):
        raise InputError(f"{path}: expected at least one throw, got none; write down some")
    return np.array(list(sums.values()), dtype=np.int64)


def _counts(path: Path, rows: Rows) -> list[tuple[str, int]]:
    lines: dict[str, int] = {}
    counts = []
    for line, (label, text) in rows:
        if label in lines:
            raise InputError(
                f"{path}, line {line}: expected each label once, got {label!r} as on line "
                f"{lines[label]}; add the two up"
            )
        lines[label] = line
        count = whole_count(text)
        if count is None:
            raise InputError(
                f"{path}, line {line}: expected a whole number from 0 to {MOST}, got {text!r}; "
                "correct the count"
            )
        counts.append((label, count))
    return counts
