"""Binary STL, which every printing program takes."""

from __future__ import annotations

from dicedesign.fabricate.files.file_format import FILE_FORMATS, Contents, FileFormat, joined
from dicedesign.geometry.meshes.stl import stl_bytes

__all__ = ["stl"]


def stl(contents: Contents) -> bytes:
    """Contents as binary STL. Triangles whose corners round together are left out."""
    return stl_bytes(*joined(contents.parts))


FILE_FORMATS.register(
    FileFormat(
        name="stl",
        line="binary STL, which every printing program takes",
        rank=10,
        unit="mm",
        upward="z",
        precision="float32",
        carries="nothing else",
        write=stl,
    )
)
