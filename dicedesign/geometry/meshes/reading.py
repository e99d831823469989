"""Read a triangle mesh, a polygon mesh or a point cloud from a file."""

from __future__ import annotations

import contextlib
import io
import logging
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, cast

import numpy as np

from dicedesign.errors import DegenerateBodyError, InputError, MeshFileError
from dicedesign.geometry.meshes.body import Body, is_rounded, make_body
from dicedesign.geometry.meshes.formats import (
    EXPORT_AGAIN,
    TEXT_READERS,
    Geometry,
    mesh_endings,
    parsed_stl,
)
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import read_file

OWN_READERS: Final[dict[str, Callable[[bytes, Path], Geometry]]] = {
    **TEXT_READERS,
    ".stl": parsed_stl,
}
"""The reader of each file ending, in lower case, that needs no other package."""

MOST_INFLATED: Final = 1 << 31
"""Bytes of all that an archive holds: 2 GiB."""


def read_body(path: str | Path) -> Body:
    """Read a body from a mesh or point file.

    STL, OBJ, OFF and XYZ are read by this package, all other formats (PLY, GLB, glTF, 3MF and
    more) by trimesh, which is imported only then. A file of several meshes gives one body, each
    mesh at its place in the scene; lines are ignored, and so are points beside a mesh.

    Parameters
    ----------
    path: the file; its ending says the format.

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
    reader = OWN_READERS.get(path.suffix.lower())
    # What is no number is told in words, below.
    with np.errstate(all="ignore"):
        if reader is not None:
            points, triangles = reader(data, path)
            rounded, count = is_rounded(points), 1
        else:
            _check_archive(data, path)
            points, triangles, rounded, count = _read_scene(path)
    if len(points) == 0:
        raise MeshFileError(f"{path}: expected a mesh or points, found neither; {EXPORT_AGAIN}")
    try:
        body = make_body(points, triangles, name=str(path), single_precision=rounded)
    except DegenerateBodyError:
        raise
    except InputError as error:
        raise MeshFileError(str(error)) from error
    if count == 1:
        return body
    notes = (f"joined {count} parts of the file", *body.notes)
    return Body(body.points, body.triangles, body.name, body.single_precision, notes)


def _check_archive(data: bytes, path: Path) -> None:
    """Raise MeshFileError for a ZIP file, as 3MF is, that would fill the memory."""
    with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(io.BytesIO(data)) as archive:
        total = sum(member.file_size for member in archive.infolist())
        if total > MOST_INFLATED:
            raise MeshFileError(
                f"{path}: expected at most {MOST_INFLATED >> 20} MiB in an archive, got "
                f"{total >> 20}; {EXPORT_AGAIN}"
            )


def _read_scene(
    path: Path,
) -> tuple[Floats, Integers, bool, int]:
    """Points, triangles, whether they were rounded, and the number of parts, by trimesh."""
    with quiet_trimesh():
        import trimesh

        endings = mesh_endings()
        if path.suffix.lower() not in endings:
            raise MeshFileError(
                f"{path}: expected a file ending out of {', '.join(sorted(endings))}, got "
                f"{path.suffix!r}; {EXPORT_AGAIN}"
            )
        try:
            loaded = trimesh.load(str(path), force="scene", process=False)
            scene = cast("trimesh.Scene", loaded)
            nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
            parts = [(scene.geometry[name], np.asarray(matrix)) for matrix, name in nodes]
        except Exception as error:  # its readers raise whatever their parsing runs into
            raise MeshFileError(
                f"{path}: expected a {path.suffix.lower()} file, got one that cannot be read; "
                f"{EXPORT_AGAIN}"
            ) from error
    meshes = [part for part in parts if len(getattr(part[0], "faces", ())) > 0]
    clouds = [part for part in parts if isinstance(part[0], trimesh.Trimesh | trimesh.PointCloud)]
    points, triangles = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)]
    rounded, count = False, 0
    for geometry, matrix in meshes or clouds:
        own = np.asarray(geometry.vertices, dtype=np.float64).reshape(-1, 3)
        rounded = rounded or is_rounded(own)
        points.append(own if np.array_equal(matrix, np.eye(4)) else _transformed(own, matrix))
        if meshes:
            faces = np.asarray(geometry.faces, dtype=np.int64) + count
            mirrored = np.linalg.det(matrix[:3, :3]) < 0  # a mirror turns a surface inside out
            triangles.append(faces[:, ::-1] if mirrored else faces)
        count += len(own)
    return np.concatenate(points), np.concatenate(triangles), rounded, len(meshes or clouds)


def _transformed(points: Floats, matrix: Floats) -> Floats:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


@contextlib.contextmanager
def quiet_trimesh() -> Iterator[None]:
    """Silence the log and the warnings of trimesh."""
    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
