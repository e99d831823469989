"""Tables of aligned columns, as commands print them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

__all__ = ["text_table"]


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
