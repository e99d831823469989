"""Mesh and point files: read any format, write STL."""

from __future__ import annotations

import contextlib
import logging
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from dicedesign.errors import DegenerateBodyError, DiceError, InputError, MeshFileError
from dicedesign.geometry.meshes.body import Body, is_rounded, make_body
from dicedesign.geometry.meshes.parsing import (
    EXPORT_AGAIN,
    STL_TITLE,
    STL_TRIANGLE,
    Geometry,
    parse_obj,
    parse_off,
    parse_ply,
    parse_stl,
    parse_xyz,
)
from dicedesign.geometry.meshes.parts import largest_part
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.files import read_file


def read_stl(data: bytes, name: str = "die.stl") -> Body:
    """Body in single precision from the content of an STL file. Raises as `read_body`."""
    points, triangles, *_ = parse_stl(data, Path(name))
    return make_body(points, triangles, name, single_precision=True)


def stl_bytes(surface: Surface) -> bytes:
    """A triangle mesh as binary STL.

    STL holds float32. Triangles with two corners that round to one float32 point are left out:
    their two other edges then coincide, so a closed mesh stays closed.

    surface: in mm. Returns bytes, the same for the same mesh. Normals of triangles that round to no
    area are zero. Raises InputError if a coordinate is not finite in float32.
    """
    with np.errstate(over="ignore"):
        points = np.asarray(surface.points, dtype=np.float64).astype(np.float32)
    if not np.isfinite(points).all():
        bad = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise InputError(
            f"STL: expected vertices that are finite in float32, got {points[bad].tolist()} in "
            f"row {bad}; repair or scale the solid"
        )
    corners = points[np.asarray(surface.triangles, dtype=np.int64)]
    following = np.roll(corners, -1, axis=1)
    corners = corners[(corners != following).any(axis=2).all(axis=1)]

    a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(len(corners), dtype=STL_TRIANGLE)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records["corners"] = corners
    return STL_TITLE + np.array(len(records), dtype="<u4").tobytes() + records.tobytes()


def _parse_scene(data: bytes, path: Path) -> Geometry:
    """Geometry of a glTF, COLLADA or AMF file."""
    # Most files are others.
    from dicedesign.geometry.meshes import gltf, xml_scenes

    ending = path.suffix.lower()
    if ending == ".amf":
        return xml_scenes.parse_amf(data, path)
    is_collada = ending in (".dae", ".zae")
    return (xml_scenes.parse_collada if is_collada else gltf.parse_gltf)(data, path)


READERS: dict[str, Callable[[bytes, Path], Geometry]] = {
    ".stl": parse_stl,
    ".obj": parse_obj,
    ".off": parse_off,
    ".xyz": parse_xyz,
    ".ply": parse_ply,
    **dict.fromkeys((".glb", ".gltf", ".dae", ".zae", ".amf"), _parse_scene),
}
"""The reader of each file ending, in lower case, but for that of 3MF files."""

THREE_MF = ".3mf"

MESH_ENDINGS = frozenset({*READERS, THREE_MF})
"""File endings such as ".stl", in lower case, that `read_body` takes."""

MILLIMETER_ENDINGS = frozenset((".3mf", ".amf", ".dae", ".zae"))
"""Endings of files that say their unit of length, and whose bodies are in millimeters."""

OTHER_ENDINGS = frozenset(
    ".3dm .3ds .blend .brep .c4d .catpart .drc .dwg .dxf .f3d .fbx .fcstd .iam "  # noqa: SIM905
    ".iges .igs .ipt .jt .lwo .mb .msh .scad .skp .sldasm .sldprt .step .stp .u3d .usd .usda "
    ".usdc .usdz .vrml .vtk .vtp .vtu .wrl .x3d .x_t".split()
)
"""Endings of files of bodies that are not read."""


def read_body(path: str | Path, item: int | None = None, *, keep_largest: bool = False) -> Body:
    """Read a body from a mesh or point file.

    A file of several meshes gives one body, each mesh at its place in the scene; lines are ignored,
    and so are points beside a mesh. Lengths of 3MF, AMF and COLLADA files are in millimeters,
    others as written.

    Parameters
    ----------
    path: the file; its ending says the format.
    item: build item of a 3MF file, from 1; None for the only one.
    keep_largest: whether to leave out all but the largest connected part and what is within it.

    Returns
    -------
    Body named by the path. It counts as single precision when its numbers are (see `is_rounded`).

    Raises
    ------
    MeshFileError: the file is missing, of an unknown format, damaged or without points, or has
        no such build item, or several and none is chosen.
    DegenerateBodyError: a coordinate is not finite, or there are fewer than 4 distinct points.
    """
    path = Path(path)
    if path.suffix.lower() == THREE_MF:
        from dicedesign.geometry.meshes.three_mf import Build

        body = Build(path).body(item)
        return largest_part(body) if keep_largest else body
    if item not in (None, 1):
        raise MeshFileError(
            f"{path}: expected item 1 of a file of one body, got {item}; leave it out"
        )
    if path.suffix.lower() not in READERS:
        raise MeshFileError(
            f"{path}: expected a file ending out of {', '.join(sorted(MESH_ENDINGS))}, got "
            f"{path.suffix!r}; {EXPORT_AGAIN}"
        )
    data = read_file(path, "a mesh or point file", error=MeshFileError)
    if not data:
        raise MeshFileError(
            f"{path}: expected a mesh or point file, got an empty one; {EXPORT_AGAIN}"
        )
    # Numbers that are not finite are refused below.
    with np.errstate(all="ignore"):
        try:
            geometry = READERS[path.suffix.lower()](data, path)
        except DiceError:
            raise
        except Exception as error:  # a parser raises whatever it runs into
            raise MeshFileError(
                f"{path}: expected a {path.suffix.lower()} file, got one that cannot be read; "
                f"{EXPORT_AGAIN}"
            ) from error
        rounded = geometry.is_rounded
        if rounded is None:
            rounded = is_rounded(geometry.points)
    if len(geometry.points) == 0:
        raise MeshFileError(f"{path}: expected a mesh or points, found neither; {EXPORT_AGAIN}")
    try:
        body = make_body(geometry.points, geometry.triangles, str(path), rounded)
    except DegenerateBodyError:
        raise
    except InputError as error:
        raise MeshFileError(str(error)) from error
    body = replace(body, notes=geometry.notes + body.notes)
    return largest_part(body) if keep_largest else body


@contextlib.contextmanager
def quiet_trimesh() -> Iterator[None]:
    """Silence the log and the warnings of trimesh, and keep it from importing manifold3d, which no
    query needs."""
    logger, hidden = logging.getLogger("trimesh"), "manifold3d" not in sys.modules
    level = logger.level
    if hidden:
        sys.modules["manifold3d"] = None  # type: ignore[assignment]
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
        # Another thread may have ended first.
        if hidden and sys.modules.get("manifold3d", hidden) is None:
            sys.modules.pop("manifold3d", None)
