"""OFF, the plainest format of meshes."""

from __future__ import annotations

from dicedesign.fabricate.files.file_format import FILE_FORMATS, Contents, FileFormat, joined
from dicedesign.fabricate.files.rows import rows

__all__ = ["off"]


def off(contents: Contents) -> bytes:
    """Contents as ASCII OFF."""
    points, triangles = joined(contents.parts)
    text = rows("{!r} {!r} {!r}\n", points) + rows("3 {} {} {}\n", triangles)
    return f"OFF\n{len(points)} {len(triangles)} 0\n{text}".encode()


FILE_FORMATS.register(
    FileFormat(
        name="off",
        line="OFF, the plainest format of programs for geometry, all digits as text",
        rank=60,
        unit="mm",
        upward="z",
        precision="float64",
        carries="nothing else",
        write=off,
    )
)
