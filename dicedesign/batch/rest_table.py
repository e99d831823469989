"""Table of the rests of a folder of meshes: a row for each rest, and its file."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from dicedesign.errors import InputError, missing_extra
from dicedesign.runtime.checkpoint import AutosavedFile
from dicedesign.runtime.files import read_file

if TYPE_CHECKING:
    from dicedesign.rest.poses import RestPoses


ColumnType = Literal["text", "whole", "real"]
"""Content of a column; numbers are empty where a file could not be analyzed."""

STAMPED: dict[str, ColumnType] = {
    "bytes": "whole",
    "modified_ns": "whole",
    "com": "text",
    "coplanar_tolerance": "text",
}
"""Columns that show whether the file or the options have changed since."""

COLUMNS: dict[str, ColumnType] = {
    "file": "text",
    "rest": "whole",
    "probability": "real",
    "normal_x": "real",
    "normal_y": "real",
    "normal_z": "real",
    "area": "real",
    "margin_deg": "real",
    "rests": "whole",
    "center_of_mass_x": "real",
    "center_of_mass_y": "real",
    "center_of_mass_z": "real",
    "center_of_mass_source": "text",
    "hull_vertices": "whole",
    "seconds": "real",
    "notes": "text",
    "error": "text",
    **STAMPED,
}
"""Columns of the table. Lengths are in the mesh's unit; rests are numbered from 1, the most
probable first; columns from "rests" on are equal in all rows of a file."""


@dataclass(frozen=True)
class Stamp:
    """State of a file when it was analyzed, and the options then.

    Attributes
    ----------
    size: size in bytes.
    modified: time of its last change, in nanoseconds since 1970.
    com, coplanar_tolerance: options as text, empty if they are left out.
    """

    size: int
    modified: int
    com: str = ""
    coplanar_tolerance: str = ""


@dataclass(frozen=True)
class Entry:
    """Rows of one file.

    Attributes
    ----------
    stamp: see `Stamp`.
    text: rows as CSV.
    rests: number of rests; 0 for a file that could not be analyzed.
    """

    stamp: Stamp
    text: str
    rests: int


def make_entry(file: str, stamp: Stamp, poses: RestPoses, seconds: float) -> Entry:
    """Rows of a file's rests. seconds: time to read and analyze it."""
    count = len(poses.probabilities)
    # The common part of the rows becomes text once.
    name = csv_line([file])[:-1]
    end = csv_line(
        [
            count,
            *poses.center_of_mass.tolist(),
            poses.center_of_mass_source,
            len(poses.hull.vertices),
            round(seconds, 6),
            " | ".join(poses.notes),
            "",
            *astuple(stamp),
        ]
    )
    text = "".join(
        # Zeros are written without a sign.
        f"{name},{rest},{p!r},{x + 0.0!r},{y + 0.0!r},{z + 0.0!r},{area!r},"
        f"{math.degrees(margin) + 0.0!r},{end}"
        for rest, (p, (x, y, z), area, margin) in enumerate(
            zip(
                poses.probabilities.tolist(),
                poses.normals.tolist(),
                poses.areas.tolist(),
                poses.margins.tolist(),
                strict=True,
            ),
            start=1,
        )
    )
    return Entry(stamp, text, count)


def broken_entry(file: str, stamp: Stamp, error: str, seconds: float = 0.0) -> Entry:
    """Row of a file that could not be analyzed, with the reason in one line."""
    row: dict[str, object] = dict.fromkeys(COLUMNS, "")
    row |= {"file": file, "rests": 0, "seconds": round(seconds, 6)}
    row |= {"error": " ".join(error.split())}
    row |= zip(STAMPED, astuple(stamp), strict=True)
    return Entry(stamp, csv_line(row.values()), 0)


def csv_line(fields: Iterable[object]) -> str:
    """Fields as a line of CSV with its line feed.

    Unlike Python's writer, it quotes a carriage return too, which would end the row for its reader.
    Bytes that are not UTF-8 are written as escapes, such as `\\udcff`.
    """
    texts = [str(field).encode("utf-8", "backslashreplace").decode() for field in fields]
    quoted = ['"' + t.replace('"', '""') + '"' if _SPECIAL.search(t) else t for t in texts]
    return ",".join(quoted) + "\n"


_SPECIAL = re.compile('[,"\r\n]')


def entries_of(rows: Iterable[Sequence[str]]) -> dict[str, Entry]:
    """Entries of a table's rows, by file. A file with missing rows has none.

    Raises ValueError: a row has no stamp.
    """
    of_name: dict[str, list[Sequence[str]]] = {}
    for row in rows:
        of_name.setdefault(row[0], []).append(row)
    entries: dict[str, Entry] = {}
    broken = set()
    for name, own in of_name.items():
        last = dict(zip(COLUMNS, own[-1], strict=True))
        size, modified, com, tolerance = (last[column] for column in STAMPED)
        stamp, rests = Stamp(int(size), int(modified), com, tolerance), int(last["rests"])
        file, text = _ITEM.sub(r"\1", name), "".join(map(csv_line, own))
        before = entries.get(file, Entry(stamp, "", 0))
        entries[file] = Entry(stamp, before.text + text, before.rests + rests)
        if len(own) != max(rests, 1):
            broken.add(file)
    return {file: entry for file, entry in entries.items() if file not in broken}


_ITEM = re.compile(r"(\.3mf)#\d+$", re.IGNORECASE)
"""End of the name of a build item of a file."""


@dataclass(frozen=True)
class TableFormat:
    """File format of a table.

    Attributes
    ----------
    encode: makes the content of a file from the table as CSV with the names of its columns.
    decode: yields the rows in the content of a file, values as in CSV, without the names. Raises
        ValueError or csv.Error for other content.
    """

    encode: Callable[[str], bytes]
    decode: Callable[[bytes], Iterator[list[str]]]


def table_format(path: Path | None) -> TableFormat:
    """Format of a table by the ending of its path.

    Raises InputError: another ending, or Parquet without pyarrow.
    """
    ending = "" if path is None else path.suffix.lower()
    if ending not in _FORMATS:
        raise InputError(
            f"--out: expected the path of a table that ends in {' or '.join(_FORMATS)}, got "
            f"{path or 'none'}; a folder needs one, such as --out rests.csv"
        )
    if ending == ".parquet":
        try:
            import pyarrow  # noqa: F401
        except ImportError as error:
            raise missing_extra("parquet", f"--out {path}", error) from error
    return _FORMATS[ending]


def _csv_rows(data: bytes) -> Iterator[list[str]]:
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
            # Missing numbers; missing texts are empty.
            null_values=[""],
            strings_can_be_null=False,
        ),
    )
    sink = BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _parquet_rows(data: bytes) -> Iterator[list[str]]:
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


_ARROW: dict[ColumnType, str] = {"text": "string", "whole": "int64", "real": "double"}
"""Arrow's names of types."""

_FORMATS = {
    ".csv": TableFormat(str.encode, _csv_rows),
    ".parquet": TableFormat(_parquet_bytes, _parquet_rows),
}
"""Formats by the ending of a path, in lower case."""


class RestTable:
    """Entries by file name, saved to a file at intervals and at the end of the context.

    The file is CSV or Parquet by its ending. It is replaced as a whole, so that it always holds
    complete entries, in the order of their names. A run resumes from the table itself.
    """

    def __init__(self, path: Path, entries: Mapping[str, Entry]) -> None:
        """Write the file. Raises OutputError; InputError as `table_format`."""
        self.path = path
        self.entries = dict(entries)
        self._format = table_format(path)
        self._file = AutosavedFile(path, "a table", self._content)
        self._file.change()

    @staticmethod
    def read(path: Path) -> dict[str, Entry]:
        """Entries of the table of an earlier run; none without a file.

        Raises InputError: the file is no such table, or as `table_format`.
        """
        decode = table_format(path).decode
        if not os.path.lexists(path):
            return {}
        data = read_file(path, "a table of an earlier run")
        try:
            return entries_of(decode(data))
        except (ValueError, csv.Error) as error:
            raise InputError(
                f"{path}: expected a table of an earlier run or no file, but "
                f"{' '.join(str(error).split())}; choose another with --out"
            ) from error

    def add(self, entries: Mapping[str, Entry]) -> None:
        """Add entries, and write the table if that is due. Raises OutputError."""
        self.entries.update(entries)
        self._file.change()

    def save(self) -> None:
        """Write the table if it is new.

        Raises OutputError: it cannot be written, or another run has written it meanwhile.
        """
        self._file.save()

    def _content(self) -> bytes:
        texts = [self.entries[file].text for file in sorted(self.entries)]
        return self._format.encode("".join([csv_line(COLUMNS), *texts]))

    def __enter__(self) -> RestTable:
        return self

    def __exit__(self, *error: object) -> None:
        self.save()
