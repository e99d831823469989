"""Files of one die's throws."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Integers
from dicedesign.throws.counts.csv_rows import csv_rows, require_equal_lengths, whole_count

__all__ = ["read_counts"]

COUNTED: Final = ["label", "count"]

ONE_BY_ONE: Final = ["label"]
"""The two headers that a file may have."""

MOST_NAMED: Final = 30
"""Labels that an error names."""


def read_counts(path: Path, labels: Sequence[str]) -> Integers:
    """Counts (k,) of k distinct labels, from a CSV file.

    The file has the columns label and count, each label at most once, those that never came up
    perhaps not at all; or only the column label, with one throw on each line. Empty lines and
    blanks around entries are ignored.

    Raises
    ------
    InputError: the file cannot be read or has other columns, an unknown label, a label twice, a
        count that is not a whole number of at least 0, or no throw.
    """
    first, rows = csv_rows(path)
    header = [entry.lower() for entry in first]
    if header not in (COUNTED, ONE_BY_ONE):
        raise InputError(
            f"{path}: expected a first line label,count or label, got {','.join(first)!r}; "
            "begin with label,count and write each label with its count on a line, or with label "
            "and write the label of each throw on a line"
        )
    require_equal_lengths(path, header, rows)
    counts, line_of = dict.fromkeys(labels, 0), dict[str, int]()
    for line, (label, *count) in rows:
        if label not in counts:
            some = ", ".join(labels[:MOST_NAMED]) + ", ..." * (len(labels) > MOST_NAMED)
            raise InputError(
                f"{path}, line {line}: expected a label of the die ({some}), got {label!r}; "
                "correct it, or leave out throws that show no label"
            )
        if count and label in line_of:
            raise InputError(
                f"{path}, line {line}: expected each label once, got {label!r} as on line "
                f"{line_of[label]}; add the two up"
            )
        line_of[label] = line
        counts[label] += whole_count(path, line, *count) if count else 1
    if not any(counts.values()):
        raise InputError(f"{path}: expected at least one throw, got none; write down some")
    return np.array(list(counts.values()), dtype=np.int64)
