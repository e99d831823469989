"""Wavefront OBJ, all digits as text."""

from __future__ import annotations

from dicedesign.fabricate.files.file_format import FILE_FORMATS, Contents, FileFormat
from dicedesign.fabricate.files.rows import rows

__all__ = ["obj"]


def obj(contents: Contents) -> bytes:
    """Contents as Wavefront OBJ: an object for each part, and a group for each colour of one."""
    text, first = f"# {contents.title}, lengths in {contents.unit}, z upward\n", 1
    for part in contents.parts:
        text += f"o {part.name}\n" + rows("v {!r} {!r} {!r}\n", part.points)
        for name, _, triangles in part.groups():
            text += f"g {name}\n" + rows("f {} {} {}\n", triangles + first)
        first += len(part.points)
    return text.encode()


FILE_FORMATS.register(
    FileFormat(
        name="obj",
        line="Wavefront OBJ, for every program of three dimensions, all digits as text",
        rank=30,
        unit="mm",
        upward="z",
        precision="float64",
        carries="parts; labels as a group",
        write=obj,
    )
)
