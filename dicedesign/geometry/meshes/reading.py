"""Mesh and point files: read any format, write STL."""

from __future__ import annotations

import contextlib
import io
import logging
import sys
import warnings
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, cast

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


OWN_READERS: dict[str, Callable[[bytes, Path], Geometry]] = {
    ".stl": parse_stl,
    ".obj": parse_obj,
    ".off": parse_off,
    ".xyz": parse_xyz,
    ".ply": parse_ply,
    **dict.fromkeys((".glb", ".gltf", ".dae", ".zae", ".amf"), _parse_scene),
}
"""The reader of each file ending, in lower case, that does without trimesh."""

OWN_ENDINGS = frozenset(OWN_READERS)

OTHER_ENDINGS = frozenset(
    ".3dm .3ds .blend .brep .c4d .catpart .drc .dwg .dxf .f3d .fbx .fcstd .iam "  # noqa: SIM905
    ".iges .igs .ipt .jt .lwo .mb .msh .scad .skp .sldasm .sldprt .step .stp .u3d .usd .usda "
    ".usdc .usdz .vrml .vtk .vtp .vtu .wrl .x3d .x_t".split()
)
"""Endings of files of bodies that are not read."""


@cache
def mesh_endings() -> frozenset[str]:
    """File endings such as ".stl", in lower case, that `read_body` takes. Imports trimesh."""
    with quiet_trimesh():
        from trimesh.exchange.load import mesh_formats

        return frozenset(f".{name}" for name in mesh_formats()) | OWN_ENDINGS


MOST_INFLATED = 1 << 31
"""Largest unpacked size of an archive in bytes, 2 GiB."""


def read_body(path: str | Path, *, keep_largest: bool = False) -> Body:
    """Read a body from a mesh or point file.

    STL, OBJ, OFF, XYZ, PLY, GLB, glTF, COLLADA and AMF are read by this package, 3MF and a few
    other formats by trimesh, which is imported only then. A file of several meshes gives one body,
    each mesh at its place in the scene; lines are ignored, and so are points beside a mesh. Lengths
    are as written, but in mm where a COLLADA or AMF file says its unit.

    Parameters
    ----------
    path: the file; its ending says the format.
    keep_largest: whether to leave out all but the largest connected part and what is within it.

    Returns
    -------
    Body named by the path. It counts as single precision when its numbers are (see `is_rounded`).

    Raises
    ------
    MeshFileError: the file is missing, of an unknown format, damaged or without points.
    DegenerateBodyError: a coordinate is not finite, or there are fewer than 4 distinct points.
    """
    path = Path(path)
    data = read_file(path, "a mesh or point file", error=MeshFileError)
    if not data:
        raise MeshFileError(
            f"{path}: expected a mesh or point file, got an empty one; {EXPORT_AGAIN}"
        )
    reader = OWN_READERS.get(path.suffix.lower(), _parse_by_trimesh)
    # Numbers that are not finite are refused below.
    with np.errstate(all="ignore"):
        try:
            geometry = reader(data, path)
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


def _check_archive(data: bytes, path: Path) -> None:
    """Raise MeshFileError for a ZIP file, as 3MF is, that would fill the memory."""
    with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(io.BytesIO(data)) as archive:
        total = sum(member.file_size for member in archive.infolist())
        if total > MOST_INFLATED:
            raise MeshFileError(
                f"{path}: expected at most {MOST_INFLATED >> 20} MiB in an archive, got "
                f"{total >> 20}; {EXPORT_AGAIN}"
            )


def _parse_by_trimesh(data: bytes, path: Path) -> Geometry:
    """Geometry of a file of another format, read by trimesh from its content alone."""
    _check_archive(data, path)
    from dicedesign.geometry.meshes.scenes import Part, join_parts

    with quiet_trimesh():
        import trimesh

        endings = mesh_endings()
        if path.suffix.lower() not in endings:
            raise MeshFileError(
                f"{path}: expected a file ending out of {', '.join(sorted(endings))}, got "
                f"{path.suffix!r}; {EXPORT_AGAIN}"
            )
        file_type = path.suffix[1:].lower()
        loaded = trimesh.load(io.BytesIO(data), file_type, force="scene", process=False)
        scene = cast("trimesh.Scene", loaded)
        parts = []
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            mesh: Any = scene.geometry[name]
            # Lines have other faces.
            if isinstance(mesh, trimesh.Trimesh | trimesh.PointCloud):
                faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
                points = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
                parts.append(Part(points, faces, np.asarray(matrix)))
    return join_parts(parts, path)


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
