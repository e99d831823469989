"""CSV files of one die's throws, read at once or written throw by throw."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Integers
from dicedesign.runtime.csv_cells import guard_cell, plain_cell
from dicedesign.runtime.files import atomic_write, read_text

MAX_COUNT = 10**9
"""Largest count."""

QUOTED = 40
"""Number of characters of a wrong entry that are quoted."""

COUNTED = ["label", "count"]

ONE_BY_ONE = ["label"]
"""Headers of a file of one die: with counts, or with one throw on each line."""

MAX_NAMED = 30
"""Largest number of labels in a message."""

Rows = list[tuple[int, list[str]]]
"""Numbers and entries of lines."""


def read_counts(path: Path, labels: Sequence[str]) -> Integers:
    """Read counts (k,) of k distinct labels from a CSV file.

    The file has the columns label and count, with each label at most once; or only the column
    label, with one throw on each line. Empty lines and blanks around entries are ignored.

    Raises
    ------
    InputError: the file cannot be read or has other columns, an unknown label, a label twice, a
        count that is not a whole number of at least 0, or no throw.
    """
    counts, line_of = dict.fromkeys(labels, 0), dict[str, int]()
    for line, (label, *count) in _rows_of_one_die(path, labels, (COUNTED, ONE_BY_ONE)):
        if count and label in line_of:
            raise InputError(
                f"{path}, line {line}: expected each label once, got {label!r} as on line "
                f"{line_of[label]}; add the two up"
            )
        line_of[label] = line
        counts[label] += whole_count(f"{path}, line {line}", *count) if count else 1
    if not any(counts.values()):
        raise InputError(f"{path}: expected at least one throw, got none; write down some")
    return np.array(list(counts.values()), dtype=np.int64)


class RollLog:
    """Throws of one die in order, saved to a file after each change.

    Attributes
    ----------
    path: of the file.
    labels: k distinct labels of the die.
    throws: labels of the throws, in order.
    """

    def __init__(self, path: Path, labels: Sequence[str]) -> None:
        """Continue the throws of a file, or begin a new one.

        Raises
        ------
        InputError: the file cannot be read, has other columns than label, or an unknown label.
        OutputError: the file cannot be written.
        """
        self.path = path
        self.labels = tuple(labels)
        self.throws: list[str] = []
        # A label of several lines is typed in one line.
        written = {_in_one_line(label): label for label in labels}
        folded = Counter(map(str.casefold, written))
        self._typed = {
            name.casefold(): label
            for name, label in written.items()
            if folded[name.casefold()] == 1
        } | written
        self.reload()
        self._save()

    @property
    def counts(self) -> Integers:
        """(k,) counts of the labels."""
        return np.array([self.throws.count(label) for label in self.labels], dtype=np.int64)

    def reload(self) -> None:
        """Read the throws from the file, which other programs may have changed or removed.

        Raises InputError: as at the beginning.
        """
        rows: Rows = []
        if self.path.exists():
            rows = _rows_of_one_die(self.path, self.labels, (ONE_BY_ONE,))
        self.throws = [label for _, (label,) in rows]

    def add(self, text: str) -> list[str]:
        """Add the throws of a text, and return their labels: one label, or several separated by
        commas or blanks. Case is ignored where labels stay distinct.

        Raises InputError for an unknown label; then none is added.
        """
        parts = text.split(",") if "," in text else text.split()
        if self._label(text) in self.labels:
            parts = [text]
        added = [self._label(part) for part in parts if part.strip()]
        for label in added:
            _check_label("roll", label, self.labels)
        self.throws += added
        self._save()
        return added

    def undo(self) -> str | None:
        """Remove the last throw, and return its label; None if there is none."""
        if not self.throws:
            return None
        label = self.throws.pop()
        self._save()
        return label

    def _label(self, text: str) -> str:
        """Label for a typed text, or the text."""
        typed = _in_one_line(text)
        return self._typed.get(typed, self._typed.get(typed.casefold(), text.strip()))

    def _save(self) -> None:
        text = io.StringIO()
        lines = [ONE_BY_ONE, *([guard_cell(label)] for label in self.throws)]
        csv.writer(text, lineterminator="\n").writerows(lines)
        atomic_write(self.path, text.getvalue().encode())


def _in_one_line(text: str) -> str:
    return " ".join(text.split())


def _rows_of_one_die(path: Path, labels: Sequence[str], headers: Sequence[list[str]]) -> Rows:
    """Lines of a file after one of the given headers; each begins with a label of the die."""
    columns, rows = csv_rows(path)
    if [entry.lower() for entry in columns] not in headers:
        either = " or ".join(",".join(one) for one in headers)
        counted = (
            "begin with label,count and write each label with its count on a line, or with label "
            "and write the label of each throw on a line"
            if COUNTED in headers
            else "write the label of each throw on a line, or name a new file"
        )
        raise InputError(
            f"{path}: expected a first line {either}, got {','.join(columns)[:QUOTED]!r}; {counted}"
        )
    check_lengths(path, columns, rows)
    for line, row in rows:
        _check_label(f"{path}, line {line}", row[0], labels)
    return rows


def _check_label(where: str, label: str, labels: Sequence[str]) -> None:
    """Raise InputError for a label that the die does not have."""
    if label not in labels:
        examples = ", ".join(labels[:MAX_NAMED]) + ", ..." * (len(labels) > MAX_NAMED)
        raise InputError(
            f"{where}: expected a label of the die ({examples}), got {label[:QUOTED]!r}; correct "
            "it, or leave out throws that show no label"
        )


def csv_rows(path: Path) -> tuple[list[str], Rows]:
    """First line of a file of throws, and later lines, without empty lines and blanks around
    entries.

    Raises InputError if the file cannot be read.
    """
    text = read_text(path, "a CSV file of throws")
    try:
        reader = csv.reader(io.StringIO(text, newline=""))
        rows = [(reader.line_num, [plain_cell(entry.strip()) for entry in row]) for row in reader]
    except csv.Error as error:
        raise InputError(
            f"{path}: expected a CSV file of throws, but {error}; correct it"
        ) from error
    (_, first), *others = [(line, row) for line, row in rows if any(row)] or [(1, [])]
    return first, others


def check_lengths(path: Path, columns: list[str], rows: Rows) -> None:
    """Raise InputError for a line with another number of entries than columns."""
    for line, row in rows:
        if len(row) != len(columns):
            raise InputError(
                f"{path}, line {line}: expected {len(columns)} entries, got "
                f"{','.join(row)[:QUOTED]!r}; write as many as the first line has"
            )


def whole_count(where: str, text: str) -> int:
    """Count of throws. Raises InputError unless it is a whole number from 0 to `MAX_COUNT`."""
    # int() would also accept "1_000", and is slow for thousands of digits.
    digits = text.lstrip("0") or text
    if text.isascii() and text.isdigit() and len(digits) <= QUOTED and int(digits) <= MAX_COUNT:
        return int(digits)
    raise InputError(
        f"{where}: expected a whole number from 0 to {MAX_COUNT}, got {text[:QUOTED]!r}; "
        "correct the count"
    )
