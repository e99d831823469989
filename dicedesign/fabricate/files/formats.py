"""A solid as a file for printing and for other programs, in the format of its ending.

Lengths are in millimetres.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import atomic_write

__all__ = ["ENDINGS", "mesh_bytes", "save_mesh"]

EARLIEST: Final = (1980, 1, 1, 0, 0, 0)
"""Time of all parts of a ZIP archive, the first that it can hold: the same solid is the same file
at any time."""

PACKAGES: Final = "http://schemas.openxmlformats.org/package/2006"
"""Start of the namespaces of the packages that 3MF files are."""

PRINTING: Final = "http://schemas.microsoft.com/3dmanufacturing"
"""Start of the namespaces of 3MF."""

MODEL: Final = "3D/3dmodel.model"
"""Part of a 3MF file that holds the solid."""

TYPES: Final = (
    f'<Types xmlns="{PACKAGES}/content-types">'
    f'<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships'
    '+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-'
    '3dmodel+xml"/></Types>'
)

RELATIONS: Final = (
    f'<Relationships xmlns="{PACKAGES}/relationships">'
    f'<Relationship Target="/{MODEL}" Id="solid" Type="{PRINTING}/2013/01/3dmodel"/>'
    "</Relationships>"
)


def save_mesh(path: Path, points: Floats, triangles: Integers) -> None:
    """Write a closed triangle mesh to a file, whole or not at all.

    path: the file, in an existing folder; its ending says the format, see `mesh_bytes`.
    points: (n, 3) in mm; triangles: (t, 3) in [0, n), counter-clockwise seen from outside.

    Raises
    ------
    InputError: no format has that ending, or coordinates that the format cannot hold.
    OutputError: the file cannot be written.
    """
    atomic_write(path, mesh_bytes(points, triangles, path.suffix, str(path)))


def mesh_bytes(points: Floats, triangles: Integers, ending: str, name: str = "mesh file") -> bytes:
    """The content of a mesh file, the same for the same mesh.

    Binary STL rounds coordinates to float32; OBJ, OFF, PLY and 3MF keep all digits.

    Parameters
    ----------
    points: (n, 3) in mm.
    triangles: (t, 3) in [0, n), counter-clockwise seen from outside.
    ending: one of `ENDINGS`, in upper or lower case.
    name: what messages call the file.

    Raises
    ------
    InputError: another ending; a coordinate is not finite, or not in float32 for STL.
    """
    writer = _WRITERS.get(ending.lower())
    if writer is None:
        raise InputError(
            f"{name}: expected a file ending out of {', '.join(ENDINGS)}, got {ending!r}; choose "
            "one of them"
        )
    places = np.asarray(points, dtype=np.float64)
    if not np.isfinite(places).all() and writer is not stl_bytes:
        row = int(np.argmin(np.isfinite(places).all(axis=1)))
        raise InputError(
            f"{name}: expected finite coordinates, got {places[row].tolist()} in row {row}; "
            "repair the solid"
        )
    return writer(places, np.asarray(triangles, dtype=np.int64))


def _rows(form: str, values: Floats | Integers) -> str:
    """A text for each row (n, 3) of numbers, with all their digits."""
    return "".join(form.format(*row) for row in values.tolist())


def _obj(points: Floats, triangles: Integers) -> bytes:
    rows = _rows("v {!r} {!r} {!r}\n", points) + _rows("f {} {} {}\n", triangles + 1)
    return f"# lengths in millimetres\n{rows}".encode()


def _off(points: Floats, triangles: Integers) -> bytes:
    rows = _rows("{!r} {!r} {!r}\n", points) + _rows("3 {} {} {}\n", triangles)
    return f"OFF\n{len(points)} {len(triangles)} 0\n{rows}".encode()


def _ply(points: Floats, triangles: Integers) -> bytes:
    header = "ply\nformat binary_little_endian 1.0\ncomment lengths in millimetres\n"
    header += f"element vertex {len(points)}\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz")
    header += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    return header.encode() + points.astype("<f8").tobytes() + faces.tobytes()


def _3mf(points: Floats, triangles: Integers) -> bytes:
    corners = _rows('<vertex x="{!r}" y="{!r}" z="{!r}"/>', points)
    faces = _rows('<triangle v1="{}" v2="{}" v3="{}"/>', triangles)
    model = (
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{PRINTING}/core/2015/02"><resources>'
        f'<object id="1" type="model"><mesh><vertices>{corners}</vertices><triangles>{faces}'
        '</triangles></mesh></object></resources><build><item objectid="1"/></build></model>'
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            (MODEL, model),
        ):
            part = zipfile.ZipInfo(name, EARLIEST)
            part.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(part, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}')
    return file.getvalue()


_WRITERS: Final[dict[str, Callable[[Floats, Integers], bytes]]] = {
    ".stl": stl_bytes,
    ".obj": _obj,
    ".3mf": _3mf,
    ".ply": _ply,
    ".off": _off,
}

ENDINGS: Final = tuple(_WRITERS)
"""Of the files that can be written, in lower case."""
