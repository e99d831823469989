"""Mesh files of every format hold their solid, or are refused in words; STL is written."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dicedesign.errors import DegenerateBodyError, MeshFileError
from dicedesign.geometry.meshes.reading import read_body, stl_bytes
from dicedesign.geometry.triangles import Surface, is_closed, solid_properties

CUBE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
CUBE_FACES = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"


def asymmetric() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    mesh.vertices = mesh.vertices * [1.0, 1.3, 0.7] + [0.1, 0.2, 0.3]
    return mesh


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def assert_unit_cube(path: Path) -> None:
    body = read_body(path)
    assert body.triangles is not None
    assert len(body.points) == 8
    assert is_closed(body.triangles)
    volume, centroid = solid_properties(body.points, body.triangles)
    assert volume == pytest.approx(1.0)
    np.testing.assert_allclose(centroid, 0.5)


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [("a.stl", 1e-7), ("a.ply", 1e-7), ("a.obj", 1e-7), ("a.off", 1e-9), ("a.glb", 1e-7)],
)
def test_a_written_mesh_is_read_back(tmp_path: Path, name: str, tolerance: float) -> None:
    mesh = asymmetric()
    mesh.export(tmp_path / name)
    body = read_body(tmp_path / name)
    assert body.triangles is not None
    assert body.name == str(tmp_path / name)
    assert body.single_precision
    assert len(body.points) == len(mesh.vertices)
    assert is_closed(body.triangles)
    np.testing.assert_allclose(body.points[body.triangles], mesh.triangles, atol=tolerance)


def test_a_binary_stl_may_begin_with_solid(tmp_path: Path) -> None:
    mesh = asymmetric()
    binary = mesh.export(file_type="stl")
    header = b"solid exported by some program\nfacet normal 0 0 1\n"
    path = write(tmp_path, "a.stl", header + binary[len(header) :])
    body = read_body(path)
    assert body.triangles is not None
    assert is_closed(body.triangles)
    np.testing.assert_array_equal(body.points[body.triangles], mesh.triangles.astype(np.float32))


def test_ascii_stl_in_any_spelling(tmp_path: Path) -> None:
    text = str(asymmetric().export(file_type="stl_ascii"))
    expected = read_body(write(tmp_path, "a.stl", text))
    for other in ("\ufeff" + text.upper(), "\n\n" + text.replace("\n", "\r\n").replace(" ", "\t ")):
        body = read_body(write(tmp_path, "b.stl", other))
        np.testing.assert_array_equal(body.points, expected.points)
        np.testing.assert_array_equal(body.triangles, expected.triangles)


@pytest.mark.parametrize(("name", "begin"), [("c.ply", None), ("c.xyz", ""), ("c.obj", "v ")])
def test_a_point_cloud_is_read_back(tmp_path: Path, name: str, begin: str | None) -> None:
    """begin: of each line; None if trimesh writes the file."""
    points = np.random.default_rng(1).normal(size=(30, 3))
    if begin is None:
        trimesh.PointCloud(points).export(tmp_path / name)
    else:
        write(tmp_path, name, "".join(f"{begin}{x} {y} {z}\n" for x, y, z in points))
    body = read_body(tmp_path / name)
    assert body.triangles is None
    np.testing.assert_allclose(body.points, points, atol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        CUBE + CUBE_FACES,
        CUBE + re.sub(r"(\d)", r"\1/7/9", CUBE_FACES),
        CUBE + re.sub(r"(\d)", r"\1//9", CUBE_FACES),
        CUBE + re.sub(r"(\d)", lambda m: str(int(m[1]) - 9), CUBE_FACES),
        CUBE_FACES + CUBE,
        "\ufeff" + (CUBE + "# cube\nmtllib none.mtl\n" + CUBE_FACES).replace("\n", " # x\r\n"),
        (CUBE + CUBE_FACES).replace("f 4 3", "f 4 \\\n3").replace("v 0 0 0\n", "v 0 0 0 1 0 0\n"),
        CUBE + "g top\n" + CUBE_FACES.replace("f 1 2 6 5", "usemtl red\no b\nf 1 2 6\nf 1 6 5"),
    ],
)
def test_obj_polygons_indices_and_comments(tmp_path: Path, text: str) -> None:
    assert_unit_cube(write(tmp_path, "cube.obj", text))


@pytest.mark.parametrize(
    "head", ["OFF\n8 7 0", "OFF 8 7 0", "COFF\n# colored\n\n8 7", "off\n8 7 0"]
)
def test_off_polygons_of_mixed_size(tmp_path: Path, head: str) -> None:
    points = CUBE.replace("v ", "")
    faces = re.sub(r"(\d)", lambda m: str(int(m[1]) - 1), CUBE_FACES).replace("f", "4")
    faces = faces.replace("4 0 1 5 4\n", "3 0 1 5\n3 0 5 4 255 0 0\n")
    assert_unit_cube(write(tmp_path, "cube.off", f"{head}\n{points}{faces}"))


def test_a_scene_is_joined_with_its_transforms(tmp_path: Path) -> None:
    mesh = asymmetric()
    mirrored = np.diag([-2.0, 1.0, 1.0, 1.0])
    mirrored[:3, 3] = [10.0, 0.0, 0.0]
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name="part")
    scene.graph.update(frame_to="again", matrix=mirrored, geometry="part")
    path = write(tmp_path, "two.glb", scene.export(file_type="glb"))
    body = read_body(path)
    assert body.triangles is not None
    assert body.notes == ("joined 2 parts of the file",)
    assert body.single_precision
    assert is_closed(body.triangles)
    volume, centroid = solid_properties(body.points, body.triangles)
    middle = mesh.center_mass
    image = middle * [-2, 1, 1] + [10, 0, 0]
    assert volume == pytest.approx(3 * mesh.volume, rel=1e-6)
    np.testing.assert_allclose(centroid, (middle + 2 * image) / 3, atol=1e-5)


GARBAGE = np.random.default_rng(0).bytes(3000)
WHOLE = trimesh.creation.box()
CUT = {ending: WHOLE.export(file_type=ending)[:-30] for ending in ("stl", "ply", "glb")}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", b"", "got an empty one; export it again as STL, PLY or OBJ"),
        ("a.obj", "# nothing\n", "expected a mesh or points, found neither; export it again"),
        ("a.stl", "hello world\n", "expected a .stl file, text that begins with"),
        ("a.stl", b"solid" + bytes(80), "got 85 bytes; export it again as STL, PLY or OBJ"),
        ("a.stl", "solid\nfacet\nvertex 1 2\n", "line 3: expected three coordinates, got '1 2'"),
        ("a.stl", "solid\nvertex 1 2 3\nfacet\n", "line 3: expected three corners before the"),
        ("a.stl", "solid\nvertex 1 2 3\n", "got a file that ends within one; export it again"),
        *[(f"a.{ending}", cut, f"expected a .{ending} file") for ending, cut in CUT.items()],
        ("a.ply", GARBAGE, "expected a .ply file, got one that cannot be read; export"),
        ("a.foo", "hello", "got '.foo'; export it again as STL, PLY or OBJ"),
        ("a.xyz", "0 0 0\n1 2 x\n", "line 2: expected three coordinates, got '1 2 x'"),
        ("a.obj", CUBE + "f 1 2\n", "line 9: expected a face of at least 3 vertices, got 'f 1 2'"),
        ("a.obj", CUBE + "f 1 2 0\n", "line 9: expected vertex numbers other than 0,"),
        ("a.obj", CUBE + f"f 1 2 {'9' * 5000}\n", "line 9: expected whole numbers, got '1 2 999"),
        ("a.obj", "v 1_0 0 0\n", "line 1: expected three coordinates, got '1_0 0 0'"),
        ("a.obj", CUBE + "f 1 2 9\n", "points 0 to 7, got point 8 in triangle 0"),
        ("a.off", "OFF\n4 1 0\n0 0 0\n", "got [4, 1] and 1 lines; export the file again"),
        ("a.off", "OFF\n1 1\n0 0 0\n4 0 0 0\n", "line 4: expected 4 vertex numbers, got '4 0 0 0'"),
        ("a.off", "OFF\n1 1\n0 0 0\n3 0 0 5\n", "expected triangles of points 0 to 0, got point 5"),
    ],
)
def test_bad_files_are_refused_in_one_line(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    name: str,
    content: str | bytes,
    message: str,
) -> None:
    path = write(tmp_path, name, content)
    with pytest.raises(MeshFileError) as caught:
        read_body(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert message in text
    assert text.isprintable()
    assert capfd.readouterr() == ("", "")


def test_missing_files_and_directories_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError, match=r"none\.stl: no such file; check the path$"):
        read_body(tmp_path / "none.stl")
    (tmp_path / "folder.stl").mkdir()
    message = r"folder\.stl: expected a mesh or point file, got a directory; name a file$"
    with pytest.raises(MeshFileError, match=message):
        read_body(tmp_path / "folder.stl")
    below = write(tmp_path, "file.txt", "x") / "a.stl"
    with pytest.raises(
        MeshFileError, match=r"a\.stl: expected a readable file, got 'Not a directory'; check"
    ):
        read_body(below)


def test_decimal_commas_are_not_taken_for_separators(tmp_path: Path) -> None:
    path = write(tmp_path, "a.xyz", "1,234 2,345 3,456\n" * 4)
    with pytest.raises(MeshFileError, match="line 1: expected decimal points, got '1,234 2,345"):
        read_body(path)
    path = write(tmp_path, "b.xyz", "1, 2, 3\n4,5,6\n7;8;9\n1.5 2,2 7\n")
    np.testing.assert_array_equal(
        read_body(path).points, [[1, 2, 3], [4, 5, 6], [7, 8, 9], [1.5, 2, 2]]
    )


def test_an_archive_that_would_fill_the_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is small itself, and nothing of it is inflated."""
    monkeypatch.setattr("dicedesign.geometry.meshes.reading.MOST_INFLATED", 1 << 22)
    path = tmp_path / "bomb.3dxml"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Manifest.xml", bytes((1 << 22) + 1))
    assert path.stat().st_size < 1 << 14
    with pytest.raises(MeshFileError, match=r"bomb\.3dxml: expected at most 4 MiB in an archive"):
        read_body(path)


@pytest.mark.parametrize("ending", ["stl", "ply"])
def test_a_signalling_nan_is_refused_without_a_warning(tmp_path: Path, ending: str) -> None:
    """Converting it is an invalid operation for the processor."""
    path = tmp_path / f"nan.{ending}"
    trimesh.creation.box().export(path)
    places = np.asarray([0.5], dtype="<f4").tobytes()
    data = path.read_bytes()
    at = data.rindex(places)
    path.write_bytes(data[:at] + b"\x01\x00\xa0\x7f" + data[at + 4 :])
    with pytest.raises(DegenerateBodyError, match="expected finite coordinates"):
        read_body(path)


def test_stl_layout():
    box = trimesh.creation.box((4.0, 2.0, 1.0))
    data = stl_bytes(Surface(box.vertices, box.faces))
    assert not data.startswith(b"solid")
    assert struct.unpack("<I", data[80:84]) == (12,)
    assert len(data) == 84 + 50 * 12
    first = np.frombuffer(data[84:132], dtype="<f4").reshape(4, 3)
    np.testing.assert_array_equal(first[0], box.face_normals[0])
    np.testing.assert_array_equal(first[1:], box.triangles[0])


def test_triangles_that_vanish_in_float32_leave_the_solid_closed():
    corners = np.array([(10, 10, 10), (30, 10, 10), (10, 40, 10), (10, 10, 50)], dtype=float)
    inside = corners[0] + 1e-9 * (corners[1] + corners[2] - 2 * corners[0])
    vertices = np.vstack([corners, inside])
    triangles = np.array([(0, 2, 4), (2, 1, 4), (1, 0, 4), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
    data = stl_bytes(Surface(vertices, triangles))
    assert struct.unpack("<I", data[80:84]) == (4,)
    mesh = trimesh.load(io.BytesIO(data), file_type="stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(20 * 30 * 40 / 6)
