"""Mesh and point files: read any format, write STL.

STL, OBJ, OFF and XYZ are parsed here: positions and faces, nothing else. The parsers take polygons
of any size, relative OBJ indices, comments and any separator, and name the line of an error.
"""

from __future__ import annotations

import contextlib
import io
import logging
import re
import sys
import warnings
import zipfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import cast

import numpy as np

from dicedesign.errors import DegenerateBodyError, InputError, MeshFileError
from dicedesign.geometry.meshes.body import Body, is_rounded, make_body, merge_positions
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import read_file

Geometry = tuple[Floats, Integers]

Line = tuple[int, list[str]]

EXPORT_AGAIN = "export it again as STL, PLY or OBJ"
"""The remedy for a file that is wrong as a whole."""

QUOTED = 40
"""Characters of a wrong line that are quoted."""

MOST_INDEX = 2**31
"""Largest vertex number."""

DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+")
"""A number with a comma for its point."""


def parse_obj(data: bytes, path: Path) -> Geometry:
    """Positions and fan-triangulated faces of a Wavefront OBJ file.

    Texture and normal indices are skipped, so seams in them do not split vertices. Groups and
    objects are joined. A fan has the signed volume and centroid of its polygon, convex or not.

    Parameters
    ----------
    data: content of the file; path: what to call it in messages.

    Returns
    -------
    (n, 3) points and (t, 3) zero-based triangles, t = 0 for a point cloud; not yet checked
    against n.

    Raises
    ------
    MeshFileError: a `v` or `f` line cannot be read.
    """
    points: list[float] = []
    triangles: list[int] = []
    for number, fields in _lines(data):
        if fields[0] == "v":
            points += _position(path, number, fields[1:4])
        elif fields[0] == "f":
            corners = [field.partition("/")[0] for field in fields[1:]]
            indices = _integers(path, number, corners)
            if 0 in indices:
                raise bad_line(path, number, "vertex numbers other than 0", " ".join(fields))
            polygon = [i - 1 if i > 0 else len(points) // 3 + i for i in indices]
            triangles += _fan(path, number, fields, polygon)
    return _arrays(points, triangles)


def parse_off(data: bytes, path: Path) -> Geometry:
    """Positions and fan-triangulated faces of an ASCII OFF file, colored or not.

    Parameters, results and errors are those of `parse_obj`.
    """
    lines = list(_lines(data))
    if not lines or lines[0][1][0].upper() not in {"OFF", "COFF", "NOFF", "CNOFF"}:
        raise MeshFileError(
            f"{path}: expected an ASCII OFF file, whose first line is OFF, got another first line; "
            f"{EXPORT_AGAIN}"
        )
    number, header = lines[0]
    if len(header) > 1:
        lines[0] = (number, header[1:])
    else:
        del lines[0]
    counts = _integers(path, lines[0][0], lines[0][1][:2]) if lines else []
    if len(counts) != 2 or min(counts) < 0 or len(lines) - 1 < sum(counts):
        raise MeshFileError(
            f"{path}: expected the numbers of vertices and faces and then as many lines, got "
            f"{counts} and {max(len(lines) - 1, 0)} lines; export the file again"
        )
    rows, faces = lines[1 : 1 + counts[0]], lines[1 + counts[0] : 1 + sum(counts)]
    points: list[float] = []
    for number, fields in rows:
        points += _position(path, number, fields[:3])
    triangles: list[int] = []
    for number, fields in faces:
        (size,) = _integers(path, number, fields[:1])
        polygon = _integers(path, number, fields[1 : 1 + size])
        if len(polygon) != size:
            raise bad_line(path, number, f"{size} vertex numbers", " ".join(fields))
        triangles += _fan(path, number, fields, polygon)
    return _arrays(points, triangles)


def parse_xyz(data: bytes, path: Path) -> Geometry:
    """Points of a text file, the first three numbers of every line; further columns are skipped.

    Parameters, results and errors are those of `parse_obj`, without triangles.
    """
    points: list[float] = []
    for number, words in _lines(data):
        if len(words) >= 3 and all(DECIMAL_COMMA.fullmatch(word) for word in words[:3]):
            raise bad_line(path, number, "decimal points", " ".join(words))
        fields = " ".join(words).replace(",", " ").replace(";", " ").split()
        points += _position(path, number, fields[:3])
    return _arrays(points, [])


def _lines(data: bytes) -> Iterator[Line]:
    """Number and fields of every line that holds any, comments and continuations resolved."""
    text = data.decode("utf-8-sig", errors="replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    pending, start = "", 0
    for number, line in enumerate(lines, start=1):
        start = start or number
        if "#" in line:
            line = line.partition("#")[0]
        line = pending + line.rstrip()
        if line.endswith("\\"):
            pending = line[:-1]
            continue
        if fields := line.split():
            yield start, fields
        pending, start = "", 0


def _position(path: Path, number: int, fields: Sequence[str]) -> tuple[float, float, float]:
    try:
        x, y, z = fields
        position = float(x), float(y), float(z)
        # float() would take "1_0" as 10.
        if "_" in x + y + z:
            raise ValueError
        return position
    except ValueError as error:
        raise bad_line(path, number, "three coordinates", " ".join(fields)) from error


def _integers(path: Path, number: int, fields: Sequence[str]) -> list[int]:
    try:
        numbers = list(map(int, fields))
        # int() would take "1_0" as 10, and numbers that no array holds.
        if "_" in "".join(fields) or max(map(abs, numbers), default=0) > MOST_INDEX:
            raise ValueError
        return numbers
    except ValueError as error:
        raise bad_line(path, number, "whole numbers", " ".join(fields)) from error


def _fan(path: Path, number: int, fields: Sequence[str], polygon: list[int]) -> list[int]:
    """Corners of the triangles of a polygon's fan, one after the other."""
    if len(polygon) == 3:
        return polygon
    if len(polygon) < 3:
        raise bad_line(path, number, "a face of at least 3 vertices", " ".join(fields))
    return [i for b, c in pairwise(polygon[1:]) for i in (polygon[0], b, c)]


def _arrays(points: list[float], triangles: list[int]) -> Geometry:
    return (
        np.array(points, dtype=np.float64).reshape(-1, 3),
        np.array(triangles, dtype=np.int64).reshape(-1, 3),
    )


def bad_line(path: Path, number: int, expected: str, line: str) -> MeshFileError:
    """Error about a line of a text file, numbered from 1, that does not hold what was expected."""
    return MeshFileError(
        f"{path}: line {number}: expected {expected}, got {line.strip()[:QUOTED]!a}; correct the "
        "line or export the file again"
    )


STL_HEADER = 84
"""Bytes before the first triangle: 80 of any text, then the number of triangles."""

STL_TITLE = b"dicedesign, binary STL, lengths in millimeters".ljust(STL_HEADER - 4)
"""Text at the start of the files that this package writes."""

STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
"""Triangle of a binary file; its last two bytes are an extension that most programs skip."""


def parse_stl(data: bytes, path: Path) -> tuple[Floats, Integers]:
    """Points and triangles of an STL file, with equal positions merged into one point.

    A file is binary when its size matches its number of triangles, whatever its header says (many
    begin with "solid"). The solids of an ASCII file are joined. Normals and colors are skipped.

    path: what to call it in messages. Returns (n, 3) points and (t, 3) triangles.
    Raises MeshFileError: the file is neither, or a `vertex` line of an ASCII file cannot be read.
    """
    count = int.from_bytes(data[STL_HEADER - 4 : STL_HEADER], "little")
    if len(data) == STL_HEADER + count * STL_TRIANGLE.itemsize:
        records = np.frombuffer(data, dtype=STL_TRIANGLE, offset=STL_HEADER)
        points = records["corners"].reshape(-1, 3).astype(np.float64)
    elif data.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and b"\0" not in data:
        corners: list[float] = []
        for number, (keyword, *fields) in _lines(data):
            if keyword.lower() == "vertex":
                corners += _position(path, number, fields)
            elif keyword.lower() == "facet" and len(corners) % 9 != 0:
                expected = "three corners before the next facet"
                raise bad_line(path, number, expected, " ".join([keyword, *fields]))
        if len(corners) % 9 != 0:
            raise MeshFileError(
                f"{path}: expected three corners in every facet, got a file that ends within one; "
                f"{EXPORT_AGAIN}"
            )
        points = np.array(corners, dtype=np.float64).reshape(-1, 3)
    else:
        raise MeshFileError(
            f"{path}: expected a .stl file, text that begins with solid or binary of {STL_HEADER} "
            f"+ {STL_TRIANGLE.itemsize} bytes per triangle, got {len(data)} bytes; {EXPORT_AGAIN}"
        )
    # The format has no shared corners, so joining them repairs nothing worth a note.
    first, place = merge_positions(points)
    return points[first], place.reshape(-1, 3)


def read_stl(data: bytes, name: str = "die.stl") -> Body:
    """Body in single precision from the content of an STL file. Raises as `read_body`."""
    points, triangles = parse_stl(data, Path(name))
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


OWN_READERS: dict[str, Callable[[bytes, Path], Geometry]] = {
    ".stl": parse_stl,
    ".obj": parse_obj,
    ".off": parse_off,
    ".xyz": parse_xyz,
}
"""The reader of each file ending, in lower case, that does without trimesh."""

THREE_MF = ".3mf"

OWN_ENDINGS = frozenset({*OWN_READERS, THREE_MF})


@cache
def mesh_endings() -> frozenset[str]:
    """File endings such as ".stl", in lower case, that `read_body` takes. Imports trimesh."""
    with quiet_trimesh():
        from trimesh.exchange.load import mesh_formats

        return frozenset(f".{name}" for name in mesh_formats()) | OWN_ENDINGS


MOST_INFLATED = 1 << 31
"""Largest unpacked size of an archive in bytes, 2 GiB."""


def read_body(path: str | Path, item: int | None = None) -> Body:
    """Read a body from a mesh or point file.

    STL, OBJ, OFF, XYZ and 3MF are read by this package, all other formats (PLY, GLB, glTF and
    more) by trimesh, which is imported only then. A file of several meshes gives one body, each
    mesh at its place in the scene; lines are ignored, and so are points beside a mesh. Bodies of
    3MF files are in millimeters, others in the unit of the file.

    Parameters
    ----------
    path: the file; its ending says the format.
    item: build item of a 3MF file, from 1; None for the only one.

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

        return Build(path).body(item)
    if item not in (None, 1):
        raise MeshFileError(
            f"{path}: expected item 1 of a file of one body, got {item}; leave it out"
        )
    data = read_file(path, "a mesh or point file", error=MeshFileError)
    if not data:
        raise MeshFileError(
            f"{path}: expected a mesh or point file, got an empty one; {EXPORT_AGAIN}"
        )
    reader = OWN_READERS.get(path.suffix.lower())
    # Numbers that are not finite are refused below.
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
    """Points, triangles, whether they were rounded, and the number of parts, read by trimesh."""
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
        moved = own @ matrix[:3, :3].T + matrix[:3, 3]
        points.append(own if np.array_equal(matrix, np.eye(4)) else moved)
        if meshes:
            faces = np.asarray(geometry.faces, dtype=np.int64) + count
            mirrored = np.linalg.det(matrix[:3, :3]) < 0  # a mirror turns a surface inside out
            triangles.append(faces[:, ::-1] if mirrored else faces)
        count += len(own)
    return np.concatenate(points), np.concatenate(triangles), rounded, len(meshes or clouds)


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
