"""Contents of mesh files in several formats, sound ones and broken ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, cast

import numpy as np

from dicedesign.geometry.meshes.formats import stl_bytes
from dicedesign.runtime.arrays import Floats, Integers


def mesh_file(ending: str, points: Floats, triangles: Integers, *, text: bool = False) -> bytes:
    """The content of a mesh file: .stl (as text if asked for), .obj, .off, .ply, .xyz, .glb, .3mf.

    points: (n, 3). triangles: (t, 3); not in .xyz.
    """
    if ending == ".stl" and not text:
        return stl_bytes(points, triangles)
    if ending in (".glb", ".3mf"):
        import trimesh

        mesh = trimesh.Trimesh(points, triangles, process=False)
        return cast("bytes", mesh.export(file_type=ending[1:]))
    return "".join(f"{line}\n" for line in _LINES[ending](points, triangles)).encode()


def _stl(points: Floats, triangles: Integers) -> list[str]:
    lines = ["solid body"]
    for corners in points[triangles]:
        vertices = [f"vertex {_row(corner)}" for corner in corners]
        lines += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
    return [*lines, "endsolid body"]


def _obj(points: Floats, triangles: Integers) -> list[str]:
    corners = [f"f {_row(triangle)}" for triangle in triangles + 1]
    return [*(f"v {_row(point)}" for point in points), *corners]


def _off(points: Floats, triangles: Integers) -> list[str]:
    head = ["OFF", f"{len(points)} {len(triangles)} 0"]
    return [*head, *map(_row, points), *(f"3 {_row(triangle)}" for triangle in triangles)]


def _ply(points: Floats, triangles: Integers) -> list[str]:
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    head += [f"property double {axis}" for axis in "xyz"]
    head += [f"element face {len(triangles)}", "property list uchar int vertex_indices"]
    rows = [*map(_row, points), *(f"3 {_row(triangle)}" for triangle in triangles)]
    return [*head, "end_header", *rows]


def _xyz(points: Floats, triangles: Integers) -> list[str]:
    return [*map(_row, points)]


def _row(values: Floats | Integers) -> str:
    return " ".join(map(repr, values.tolist()))


_LINES: Final[dict[str, Callable[[Floats, Integers], list[str]]]] = {
    ".stl": _stl,
    ".obj": _obj,
    ".off": _off,
    ".ply": _ply,
    ".xyz": _xyz,
}
"""Of the formats that are text."""


def _huge_count(points: Floats, triangles: Integers) -> bytes:
    data = stl_bytes(points, triangles)
    return data[:80] + b"\xff\xff\xff\x7f" + data[84:]


def _with_corner(index: int) -> Callable[[Floats, Integers], bytes]:
    def content(points: Floats, triangles: Integers) -> bytes:
        return mesh_file(".obj", points, triangles) + f"f 1 2 {index}\n".encode()

    return content


def _with_point(text: str) -> Callable[[Floats, Integers], bytes]:
    return lambda points, triangles: mesh_file(".xyz", points, triangles) + f"{text}\n".encode()


def _flat(points: Floats, triangles: Integers) -> bytes:
    return mesh_file(".off", np.round(points) * [1.0, 1.0, 0.0], triangles)


BROKEN: Final[tuple[tuple[str, Callable[[Floats, Integers], bytes]], ...]] = (
    (".stl", lambda points, triangles: b""),
    (".stl", lambda points, triangles: stl_bytes(points, triangles)[:-7]),
    (".stl", _huge_count),
    (".stl", lambda points, triangles: b"solid\nfacet\nvertex 1 2 three\n"),
    (".ply", lambda points, triangles: mesh_file(".ply", points, triangles)[:60]),
    (".glb", lambda points, triangles: b"glTF\2\0\0\0" + b"\xff" * 40),
    (".3mf", lambda points, triangles: b"PK\3\4" + b"\0" * 60),
    (".obj", _with_corner(10**9)),
    (".obj", _with_corner(10**30)),
    (".off", lambda points, triangles: b"OFF\n1000000000 4 0\n1 2 3\n"),
    (".off", _flat),
    (".xyz", lambda points, triangles: mesh_file(".xyz", points[:3], triangles)),
    (".xyz", _with_point("nan 0 0")),
    (".xyz", _with_point("1e999 0 0")),
    (".xyz", _with_point("1 2 \x00")),
    (".xyz", lambda points, triangles: b"\xff\xfe\x00\x01" * 99),
)
"""Ending and content of files that have no answer, made from sound meshes."""
