"""Binary PLY in double precision."""

from __future__ import annotations

import numpy as np

from dicedesign.fabricate.files.file_format import FILE_FORMATS, Contents, FileFormat, joined

__all__ = ["ply"]


def ply(contents: Contents) -> bytes:
    """Contents as little-endian binary PLY."""
    points, triangles = joined(contents.parts)
    header = f"ply\nformat binary_little_endian 1.0\ncomment lengths in {contents.unit}\n"
    header += f"element vertex {len(points)}\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz")
    header += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    return header.encode() + points.astype("<f8").tobytes() + faces.tobytes()


FILE_FORMATS.register(
    FileFormat(
        name="ply",
        line="binary PLY, small, all digits",
        rank=50,
        unit="mm",
        upward="z",
        precision="float64",
        carries="nothing else",
        write=ply,
    )
)
