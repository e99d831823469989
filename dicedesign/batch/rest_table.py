"""Table of the rests of many bodies: a row for each rest, and its file."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dicedesign.batch.rest_rows import MASS_NAMES, RestOptions, facet_columns, mass_values
from dicedesign.errors import InputError, missing_extra
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.robots.links import NamedBody
from dicedesign.geometry.sphere import quaternions
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.checkpoint import AutosavedFile
from dicedesign.runtime.csv_cells import FORMULA, guard_cell, plain_cell
from dicedesign.runtime.files import json_text, read_file

ColumnType = Literal["text", "whole", "real"]
"""Content of a column; numbers are empty where a file could not be analyzed."""

STAMPED: dict[str, ColumnType] = {
    "bytes": "whole",
    "modified_ns": "whole",
    "com": "text",
    "coplanar_tolerance": "text",
    "density": "text",
    "all_facets": "text",
    "masses": "text",
}
"""Columns that show whether the file or the options have changed since."""

COLUMNS: dict[str, ColumnType] = {
    "file": "text",
    "body": "text",
    **dict.fromkeys(["rest", "facet", "rolls_to"], "whole"),
    **dict.fromkeys(["probability", "normal_x", "normal_y", "normal_z", "area"], "real"),
    **dict.fromkeys(["margin_deg", "depth", "height"], "real"),
    **dict.fromkeys(["x", "y", "z", "qw", "qx", "qy", "qz"], "real"),
    "rests": "whole",
    "facets": "whole",
    "center_of_mass_x": "real",
    "center_of_mass_y": "real",
    "center_of_mass_z": "real",
    "center_of_mass_source": "text",
    "hull_vertices": "whole",
    "unit": "text",
    **dict.fromkeys(MASS_NAMES, "real"),
    "seconds": "real",
    "notes": "text",
    "error": "text",
    **STAMPED,
}
"""Columns of the table. Lengths are in `unit` where the name says none; rests are numbered from 1,
the most probable first; columns from "rests" on are equal in all rows of a body."""


@dataclass(frozen=True)
class Stamp:
    """State of a file when it was analyzed, and the options then.

    Attributes
    ----------
    size: size in bytes.
    modified: time of its last change, in nanoseconds since 1970.
    com, coplanar_tolerance, density, all_facets: options as text, empty if they are left out.
    masses: what was given about this file alone.
    """

    size: int
    modified: int
    com: str = ""
    coplanar_tolerance: str = ""
    density: str = ""
    all_facets: str = ""
    masses: str = ""


def make_stamp(file: str, state: tuple[int, int], options: RestOptions) -> Stamp:
    """Stamp of a file. state: its size and the time of its last change."""
    com, tolerance, density = (
        options.center_of_mass,
        options.coplanar_tolerance,
        options.density,
    )
    given = options.masses.get(file)
    return Stamp(
        *state,
        com=",".join(map(repr, com)) if isinstance(com, tuple) else com or "",
        coplanar_tolerance="" if tolerance is None else repr(tolerance),
        density="" if density is None else repr(density),
        all_facets="yes" if options.all_facets else "",
        masses="" if given is None else repr(tuple(given)),
    )


@dataclass(frozen=True)
class Entry:
    """Rows of one file.

    Attributes
    ----------
    stamp: see `Stamp`.
    text: rows as CSV.
    rests: number of rests; 0 for a file that could not be analyzed.
    failures: number of its bodies that could not be analyzed.
    """

    stamp: Stamp
    text: str
    rests: int
    failures: int = 0

    def __add__(self, other: Entry) -> Entry:
        """Rows of more bodies of this file."""
        text, failures = self.text + other.text, self.failures + other.failures
        return Entry(self.stamp, text, self.rests + other.rests, failures)


def make_entry(
    file: str,
    stamp: Stamp,
    source: NamedBody,
    body: Body,
    poses: RestPoses,
    options: RestOptions,
    seconds: float,
) -> Entry:
    """Rows of a body of a file. seconds: time to read and analyze it."""
    columns = facet_columns(poses, options.all_facets)
    motions, count = columns["transform"], len(poses.facets)
    mass = mass_values(source, body, poses, options.of_file(file)[1])
    # The common part of the rows becomes text once.
    start = csv_line([file, source.name])[:-1]
    end = csv_line(
        [
            count,
            len(poses.hull.normals),
            *poses.center_of_mass.tolist(),
            poses.center_of_mass_source,
            len(poses.hull.vertices),
            source.unit,
            *("" if value is None else value for value in mass.values()),
            round(seconds, 6),
            " | ".join(poses.notes),
            "",
            *astuple(stamp),
        ]
    )
    whole = zip(*(columns[name] for name in ("rest", "facet", "rolls_to")), strict=True)
    real = np.column_stack(
        [
            columns["probability"],
            columns["normal"],
            columns["area"],
            np.array(columns["margin_deg"], dtype=np.float64),
            columns["depth"],
            columns["height"],
            motions[:, :3, 3],
            quaternions(motions[:, :3, :3]),
        ]
    )
    # Zeros are written without a sign, what is missing is empty.
    text = "".join(
        f"{start},{rest or ''},{facet},{rolls_to},"
        f"{','.join('' if x != x else repr(x) for x in numbers)},{end}"
        for (rest, facet, rolls_to), numbers in zip(whole, (real + 0.0).tolist(), strict=True)
    )
    return Entry(stamp, text, count)


def broken_entry(
    file: str, stamp: Stamp, error: str, seconds: float = 0.0, body: str = ""
) -> Entry:
    """Row of a body that could not be analyzed, with the reason in one line."""
    row: dict[str, object] = dict.fromkeys(COLUMNS, "")
    row |= {"file": file, "body": body, "rests": 0, "seconds": round(seconds, 6)}
    row |= {"error": " ".join(error.split())}
    row |= zip(STAMPED, astuple(stamp), strict=True)
    return Entry(stamp, csv_line(row.values()), 0, 1)


def csv_line(fields: Iterable[object]) -> str:
    """Fields as a line of CSV with its line feed.

    Unlike Python's writer, it quotes a carriage return too, which would end the row for its reader.
    Bytes that are not UTF-8 are written as escapes, such as `\\udcff`, and formulas as texts.
    """
    cells = map(guard_cell, fields)
    texts = [str(field).encode("utf-8", "backslashreplace").decode() for field in cells]
    quoted = ['"' + t.replace('"', '""') + '"' if _SPECIAL.search(t) else t for t in texts]
    return ",".join(quoted) + "\n"


MAX_TABLE_BYTES = 1 << 30
"""Limit of the file of a table: 1 GiB."""

MAX_ROWS = 10_000_000
"""Limit of the rows of a Parquet file, in which a byte can stand for many."""

ROWS_AT_ONCE = 1000
"""Rows of a Parquet file that are unpacked at once."""

MAX_CELL_BYTES = 131_072
"""Limit of a text in a Parquet file, as Python's reader has it for CSV."""

_SPECIAL = re.compile('[,"\r\n]')


def entries_of(rows: Iterable[Sequence[str]]) -> dict[str, Entry]:
    """Entries of a table's rows, by file. A file with missing rows has none.

    Raises ValueError: a row has no stamp.
    """
    of_file: dict[str, list[Sequence[str]]] = {}
    for row in rows:
        of_file.setdefault(row[0], []).append(row)
    entries = {}
    for file, own in of_file.items():
        bodies: dict[str, list[dict[str, str]]] = {}
        for row in own:
            bodies.setdefault(row[1], []).append(dict(zip(COLUMNS, row, strict=True)))
        last = [rows[-1] for rows in bodies.values()]
        size, modified, *texts = (last[-1][name] for name in STAMPED)
        stamp = Stamp(int(size), int(modified), *texts)
        rests = [int(row["rests"]) for row in last]
        name = "facets" if stamp.all_facets else "rests"
        if all(len(bodies[row["body"]]) == max(int(row[name] or 0), 1) for row in last):
            text = "".join(map(csv_line, own))
            entries[file] = Entry(stamp, text, sum(rests), rests.count(0))
    return entries


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
        yield list(map(plain_cell, row))


def _parquet_bytes(text: str) -> bytes:
    from pyarrow import BufferOutputStream, BufferReader, compute, parquet, schema
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
    for column, (name, kind) in enumerate(COLUMNS.items()):
        if kind == "text":
            guarded = f"^'({FORMULA.pattern})"
            texts = compute.replace_substring_regex(table[name], guarded, r"\1", max_replacements=1)
            table = table.set_column(column, name, texts)
    sink = BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _parquet_rows(data: bytes) -> Iterator[list[str]]:
    from pyarrow import ArrowException, BufferReader, compute, parquet

    try:
        file = parquet.ParquetFile(BufferReader(data))
        columns_of_file = [(field.name, str(field.type)) for field in file.schema_arrow]
        if columns_of_file != [(name, _ARROW[kind]) for name, kind in COLUMNS.items()]:
            raise ValueError("its columns are others")
        if file.metadata.num_rows > MAX_ROWS:
            raise ValueError(f"it has {file.metadata.num_rows} rows, more than {MAX_ROWS}")
        # Texts that a file holds once and repeats stay so here.
        texts = [name for name, kind in COLUMNS.items() if kind == "text"]
        file = parquet.ParquetFile(BufferReader(data), read_dictionary=texts)
        for batch in file.iter_batches(ROWS_AT_ONCE):
            for name in texts:
                lengths = compute.binary_length(batch[name].dictionary)
                if (compute.max(lengths).as_py() or 0) > MAX_CELL_BYTES:
                    raise ValueError(f"it has texts of more than {MAX_CELL_BYTES} bytes")
            columns = [
                ["" if value is None else str(value) for value in column.to_pylist()]
                for column in batch.columns
            ]
            yield from map(list, zip(*columns, strict=True))
    except (ArrowException, OSError) as error:
        raise ValueError(f"it is no Parquet file that can be read: {error}") from error


def _json_bytes(text: str) -> bytes:
    parse: dict[ColumnType, Callable[[str], Any]] = {"text": str, "whole": int, "real": float}
    rows = [
        {
            name: parse[kind](value) if value or kind == "text" else None
            for (name, kind), value in zip(COLUMNS.items(), row, strict=True)
        }
        for row in _csv_rows(text.encode())
    ]
    return json_text(rows).encode()


def _json_rows(data: bytes) -> Iterator[list[str]]:
    try:
        rows = json.loads(data)
    except RecursionError as error:
        raise ValueError("its values are too deep within each other") from error
    if not isinstance(rows, list):
        raise ValueError("it is no list of rows")
    for row in rows:
        if not isinstance(row, dict) or list(row) != list(COLUMNS):
            raise ValueError("its columns are others")
        yield ["" if value is None else str(value) for value in row.values()]


_ARROW: dict[ColumnType, str] = {"text": "string", "whole": "int64", "real": "double"}
"""Arrow's names of types."""

_FORMATS = {
    ".csv": TableFormat(str.encode, _csv_rows),
    ".parquet": TableFormat(_parquet_bytes, _parquet_rows),
    ".json": TableFormat(_json_bytes, _json_rows),
}
"""Formats by the ending of a path, in lower case."""


class RestTable:
    """Entries by file name, saved to a file at intervals and at the end of the context.

    The file is CSV, Parquet or JSON by its ending. It is replaced as a whole, so that it always
    holds complete entries, in the order of their names. A run resumes from the table itself.
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
        data = read_file(path, "a table of an earlier run", most=MAX_TABLE_BYTES)
        try:
            return entries_of(decode(data))
        except Exception as error:
            # Errors of CSV, JSON or Parquet and of missing entries all mean another file.
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
