"""Rows of the table of a folder of meshes: one for each rest, as text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

if TYPE_CHECKING:
    from dicedesign.rest.poses import RestPoses

__all__ = [
    "COLUMNS",
    "STAMPED",
    "ColumnType",
    "Entry",
    "Stamp",
    "analysed_entry",
    "broken_entry",
    "csv_line",
    "entries_of",
]

ColumnType = Literal["text", "whole", "real"]
"""Content of a column; numbers are empty where a file could not be analysed."""

PER_REST: Final[dict[str, ColumnType]] = {
    "rest": "whole",
    "probability": "real",
    "normal_x": "real",
    "normal_y": "real",
    "normal_z": "real",
    "area": "real",
    "margin_deg": "real",
}
"""Columns of one rest; rests are numbered from 1, the most probable first."""

STAMPED: Final[dict[str, ColumnType]] = {
    "bytes": "whole",
    "modified_ns": "whole",
    "com": "text",
    "coplanar_tolerance": "text",
}
"""Columns that tell whether rows are still those of the file and of the options."""

COLUMNS: Final[dict[str, ColumnType]] = {
    "file": "text",
    **PER_REST,
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
"""Of the table. Lengths are in the mesh's unit; those after `PER_REST` are of the file."""


@dataclass(frozen=True)
class Stamp:
    """State of a file when it was analysed, and the options then.

    Attributes
    ----------
    size: of the file, in bytes.
    modified: time of its last change, in nanoseconds since 1970.
    com, coplanar_tolerance: the options as text, empty where they were left out.
    """

    size: int
    modified: int
    com: str = ""
    coplanar_tolerance: str = ""


@dataclass(frozen=True)
class Entry:
    """The rows of one file.

    Attributes
    ----------
    stamp: see `Stamp`.
    text: the rows as CSV.
    rests: their number; 0 for a file that could not be analysed.
    """

    stamp: Stamp
    text: str
    rests: int


def analysed_entry(file: str, stamp: Stamp, poses: RestPoses, seconds: float) -> Entry:
    """The rows of a file's rests; `seconds` were spent on reading and analysing it."""
    count = len(poses.probabilities)
    # What the rows have in common becomes text once.
    name = csv_line([escaped_name(file)])[:-1]
    end = csv_line(
        [
            count,
            *poses.center_of_mass.tolist(),
            poses.center_of_mass_source,
            len(poses.hull.vertices),
            round(seconds, 6),
            " | ".join(poses.notes),
            "",
            *_stamped(stamp),
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
    """The row of a file that could not be analysed, with the reason in one line."""
    row: dict[str, object] = dict.fromkeys(COLUMNS, "")
    row |= {"file": escaped_name(file), "rests": 0, "seconds": round(seconds, 6)}
    row |= {"error": " ".join(error.split())}
    row |= zip(STAMPED, _stamped(stamp), strict=True)
    return Entry(stamp, csv_line(row.values()), 0)


def _stamped(stamp: Stamp) -> list[object]:
    return [stamp.size, stamp.modified, stamp.com, stamp.coplanar_tolerance]


def csv_line(fields: Iterable[object]) -> str:
    """Fields as a line of CSV with its line feed.

    Unlike that of Python, a carriage return is quoted too, which would end the row for its reader.
    What is not UTF-8 is an escape, such as `\\udcff`.
    """
    texts = [str(field).encode("utf-8", "backslashreplace").decode() for field in fields]
    quoted = ['"' + t.replace('"', '""') + '"' if _SPECIAL.search(t) else t for t in texts]
    return ",".join(quoted) + "\n"


_SPECIAL: Final = re.compile('[,"\r\n]')

_ESCAPED: Final = re.compile(r"(\\+)(udc[89a-f][0-9a-f])")

_TO_ESCAPE: Final = re.compile(r"(\\*)(udc[89a-f][0-9a-f]|[\udc80-\udcff])")


def escaped_name(name: str) -> str:
    """The name of a file as a table has it: a byte that is not UTF-8 is an escape, such as
    `\\udcff`, and backslashes before one, or before letters that would look like one, are
    doubled."""

    def escape(match: re.Match[str]) -> str:
        slashes, rest = match.groups()
        return 2 * slashes + (rest if len(rest) > 1 else f"\\u{ord(rest):x}")

    return _TO_ESCAPE.sub(escape, name)


def _own_name(escaped: str) -> str:
    """The name that `escaped_name` has made this from."""

    def unescape(match: re.Match[str]) -> str:
        slashes, rest = match.groups()
        byte = chr(int(rest[1:], 16)) if len(slashes) % 2 else rest
        return slashes[: len(slashes) // 2] + byte

    return _ESCAPED.sub(unescape, escaped)


def entries_of(rows: Iterable[Sequence[str]]) -> dict[str, Entry]:
    """The entries of a table's rows, by file. A file whose rows are not all there has none.

    Raises ValueError: a row has no stamp.
    """
    of_file: dict[str, list[Sequence[str]]] = {}
    for row in rows:
        of_file.setdefault(_own_name(row[0]), []).append(row)
    entries = {}
    for file, own in of_file.items():
        last = dict(zip(COLUMNS, own[-1], strict=True))
        size, modified, com, tolerance = (last[name] for name in STAMPED)
        stamp, rests = Stamp(int(size), int(modified), com, tolerance), int(last["rests"])
        if len(own) == max(rests, 1):
            entries[file] = Entry(stamp, "".join(map(csv_line, own)), rests)
    return entries
