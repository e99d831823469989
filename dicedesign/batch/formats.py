"""The two formats of a table of rests, CSV and Parquet: the same rows, in whole files."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dicedesign.batch.rows import COLUMNS, ColumnType
from dicedesign.errors import InputError, missing_extra

__all__ = ["TableFormat", "table_format"]

Rows = Iterator[list[str]]


@dataclass(frozen=True)
class TableFormat:
    """A way to keep a table in a file.

    Attributes
    ----------
    encode: the content of the file for the table as CSV, beginning with the names of its columns.
    decode: the rows in the content of a file, their values as they are in CSV, without the names.
        Raises ValueError or csv.Error where it is no such table.
    """

    encode: Callable[[str], bytes]
    decode: Callable[[bytes], Rows]


def table_format(path: Path | None) -> TableFormat:
    """The format that the ending of a table's path tells.

    Raises InputError, naming the option --out: it tells none, or Parquet, and pyarrow is missing.
    """
    ending = "" if path is None else path.suffix.lower()
    if ending not in _FORMATS:
        raise InputError(
            f"--out: expected the path of a table that ends in {' or '.join(_FORMATS)}, got "
            f"{path}; a folder needs one, such as --out rests.csv"
        )
    if ending == ".parquet":
        try:
            import pyarrow  # noqa: F401
        except ImportError as error:
            raise missing_extra("parquet", f"--out {path}", error) from error
    return _FORMATS[ending]


def _csv_rows(data: bytes) -> Rows:
    text = io.StringIO(data.decode("utf-8"), newline="")
    rows = csv.reader(text, strict=True)
    if next(rows, []) != list(COLUMNS):
        raise ValueError("its columns are others")
    for row in rows:
        if len(row) != len(COLUMNS):
            raise ValueError(f"line {rows.line_num} has {len(row)} columns of {len(COLUMNS)}")
        yield row


def _parquet_bytes(text: str) -> bytes:
    from pyarrow import BufferOutputStream, BufferReader, parquet, schema
    from pyarrow import csv as arrow_csv

    table = arrow_csv.read_csv(
        BufferReader(text.encode("utf-8")),
        parse_options=arrow_csv.ParseOptions(newlines_in_values=True),
        convert_options=arrow_csv.ConvertOptions(
            column_types=schema([(name, _ARROW[kind]) for name, kind in COLUMNS.items()]),
            # Numbers that are left out; texts are empty.
            null_values=[""],
            strings_can_be_null=False,
        ),
    )
    sink = BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _parquet_rows(data: bytes) -> Rows:
    from pyarrow import ArrowException, BufferReader, parquet

    try:
        table = parquet.read_table(BufferReader(data))
    except (ArrowException, OSError) as error:
        raise ValueError(f"it is no Parquet file that can be read: {error}") from error
    columns_of_file = [(field.name, str(field.type)) for field in table.schema]
    if columns_of_file != [(name, _ARROW[kind]) for name, kind in COLUMNS.items()]:
        raise ValueError("its columns are others")
    for batch in table.to_batches():
        columns = [
            ["" if value is None else str(value) for value in column.to_pylist()]
            for column in batch.columns
        ]
        yield from map(list, zip(*columns, strict=True))


_ARROW: Final[dict[ColumnType, str]] = {"text": "string", "whole": "int64", "real": "double"}
"""Arrow's names of types."""

_FORMATS: Final = {
    ".csv": TableFormat(str.encode, _csv_rows),
    ".parquet": TableFormat(_parquet_bytes, _parquet_rows),
}
"""By the ending of a path, in lower case."""
