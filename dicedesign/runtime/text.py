"""Texts for people: names from outside in one line, and tables of aligned columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def printable(text: object) -> str:
    """A text, or the text of a path, in one line of UTF-8: whatever cannot be printed, such as a
    line feed or a byte of a file's name that is not UTF-8, as an escape of Python's."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in str(text))


def text_table(columns: Sequence[tuple[str, str]], rows: Iterable[Sequence[object]]) -> list[str]:
    """Lines of a table, beginning with that of its columns' names.

    columns: name and format of each, as of `format`. One whose format is empty is of texts and
    begins at the left; the others, numbers or texts of the format ">", end at the right.
    rows: a value for each column.
    """
    cells = [[name for name, _ in columns]]
    for row in rows:
        cells.append([format(value, spec) for value, (_, spec) in zip(row, columns, strict=True)])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if spec else cell.ljust(width)
            for cell, width, (_, spec) in zip(row, widths, columns, strict=True)
        ).rstrip()
        for row in cells
    ]
