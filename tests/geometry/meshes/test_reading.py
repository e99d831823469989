"""Mesh files of every format hold their solid, or are refused in words; STL is written."""

from __future__ import annotations

import base64
import importlib
import io
import json
import os
import re
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np
import pygltflib
import pytest
import trimesh
from common.paths import public_data

from dicedesign.errors import DegenerateBodyError, MeshFileError
from dicedesign.geometry.meshes.reading import quiet_trimesh, read_body, stl_bytes
from dicedesign.geometry.triangles import Surface, is_closed, solid_properties
from dicedesign.rest.poses import rest_poses

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


SIDES = np.array([1.0, 2.0, 3.0])
BOX = trimesh.creation.box(SIDES)
POINTS, TRIANGLES = np.array(BOX.vertices), np.array(BOX.faces)


def words(rows: object, after: str = "", before: str = "") -> list[str]:
    lines = np.asarray(rows).tolist()
    return [" ".join([before, *map(repr, line), after]).strip() for line in lines]


def off_text(head: str, after: str = "", color: str = "", line: str = "\n") -> str:
    points, faces = words(POINTS, after), words(TRIANGLES, color, before="3")
    return line.join([head, *points, *faces])


def ply_text(head: str = "", faces: int = 12, line: str = "\n") -> str:
    axes = [f"property double {axis}" for axis in "xyz"]
    lines = ["ply", "format ascii 1.0", head, "element vertex 8", *axes, f"element face {faces}"]
    lines += ["property list uchar int vertex_index", "end_header"]
    return line.join([*lines, *words(POINTS), "", *words(TRIANGLES, before="3")]) + line


def mixed_ply(order: str) -> bytes:
    """Quadrilaterals and triangles with a color, and a list after them."""
    name = {"<": "little", ">": "big"}[order]
    head = f"ply\r\nformat binary_{name}_endian 1.0\r\nelement vertex 8\r\nproperty uchar red\r\n"
    head += "".join(f"property float {axis}\r\n" for axis in "xyz") + "element face 7\r\n"
    head += "property list uint8 uint16 vertex_indices\r\nproperty list int uchar flags\r\n"
    corners = SIDES * [[float(word) for word in line.split()[1:]] for line in CUBE.splitlines()]
    data = b"".join(struct.pack(f"{order}B3f", 7, *point) for point in corners)
    faces = [[int(i) - 1 for i in line.split()[1:]] for line in CUBE_FACES.splitlines()]
    faces[2:3] = [[0, 1, 5], [0, 5, 4]]
    for n, face in enumerate(faces):
        data += struct.pack(f"{order}B{len(face)}HI{n}B", len(face), *face, n, *range(n))
    return f"{head}end_header\r\n".encode() + data


def collada(unit: str, primitives: str, place: str = "") -> str:
    """A box in a node below one that is turned and moved."""
    corners = " ".join(words(POINTS))
    return f"""<?xml version="1.0"?>
    <COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset>{unit}</asset>
    <library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="24">
    {corners}</float_array><technique_common><accessor source="#a" count="8" stride="3"/>
    </technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    {primitives}</mesh></geometry></library_geometries><library_nodes><node id="n">{place}
    <instance_geometry url="#g"/></node></library_nodes><library_visual_scenes><visual_scene id="s">
    <node><translate>5 6 7</translate><rotate>1 2 2 40</rotate><instance_node url="#n"/></node>
    </visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene>
    </COLLADA>"""


DAE_INPUTS = '<input semantic="NORMAL" source="#v" offset="0"/>'
DAE_INPUTS += '<input semantic="VERTEX" source="#v" offset="1"/>'
DAE_TRIANGLES = f'<triangles count="12">{DAE_INPUTS}<p>{{}}</p></triangles>'.format(
    " ".join(f"0 {i}" for i in TRIANGLES.ravel())
)
DAE_FANS = "<trifans>{}{}</trifans>".format(
    DAE_INPUTS, "".join(f"<p>0 {a} 0 {b} 0 {c}</p>" for a, b, c in TRIANGLES)
)


def amf(unit: str, more: str = "", extra: str = "") -> str:
    vertices = "".join(
        f"<vertex><coordinates><x>{x}</x><y>{y}</y><z>{z}</z></coordinates></vertex>"
        for x, y, z in POINTS
    )
    triangles = "".join(
        f"<triangle><v1>{a}</v1><v2>{b}</v2><v3>{c}</v3></triangle>" for a, b, c in TRIANGLES
    )
    return f"""<amf unit="{unit}"><object id="1"><mesh><vertices>{vertices}</vertices>
    <volume>{triangles}</volume>{extra}</mesh></object>{more}</amf>"""


def zipped(name: str, text: str) -> bytes:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, text)
    return archive.getvalue()


def gltf(mode: int = 4, **changes: object) -> str:
    """A box, turned and moved, its data in the file."""
    order = TRIANGLES.ravel()
    if mode == 5:  # a strip that repeats corners between triangles
        order = np.concatenate([[a, a, a, b, c, c] for a, b, c in TRIANGLES])
    data = POINTS.astype("<f4").tobytes() + order.astype("<u2").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1], "translation": [5, 6, 7], "rotation": [0.6, 0.0, 0.0, 0.8]},
            {"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 3, 4, 5, 1]},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": len(order), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 2 * len(order)},
        ],
        "buffers": [{"byteLength": len(data), "uri": uri}],
    }
    return json.dumps({**document, **changes})


INCH = '<unit name="inch" meter="0.0254"/>'
ASCII_STL, OBJ = str(BOX.export(file_type="stl_ascii")), str(BOX.export(file_type="obj"))
MODIFIER = '<volume><metadata type="slic3r.modifier">1</metadata><triangle><v1>0</v1><v2>1</v2>'
MODIFIER += '<v3>7</v3></triangle></volume><volume type="support"/>'
TURNED = '<constellation id="2"><instance objectid="1"><deltax>9</deltax><rx>20</rx><rz>50</rz>'
TURNED += "</instance></constellation>"
BOXES: dict[str, tuple[str | bytes, float]] = {
    "one_line.off": (off_text("OFF 8 12 18", line=" "), 6.0),
    "numbers.off": (off_text("OFF 8 12 18").replace(" ", "\n"), 6.0),
    "glued.off": (off_text("OFF8 12 0", color="0.5 1 0"), 6.0),
    "colored.off": (off_text("COFF\n8 12", "255 0 0 255", "# face\n"), 6.0),
    "all.off": (off_text("STCN4OFF 8 12 0", "1 0 0 1 .1 .2 .3 1 .5 .5", line="\r"), 6.0),
    "weights.off": (off_text("4OFF 8 12 0", "0.5"), 48.0),
    "blank.ply": (ply_text("\n\ncomment x\n").replace("\n0.5", "\n \n\n0.5"), 6.0),
    "one_line.ply": (ply_text().replace("5\n", "5 ").replace("\n3", " 3"), 6.0),
    "returns.ply": (ply_text(line="\r"), 6.0),
    "little.ply": (mixed_ply("<"), 6.0),
    "big.ply": (mixed_ply(">"), 6.0),
    "u16.obj": (OBJ.encode("utf-16"), 6.0),
    "u16be.obj": (OBJ.encode("utf-16-be"), 6.0),
    "mark.obj": (OBJ.encode("utf-8-sig"), 6.0),
    "comment.stl": ("; by hand\n// of a box\n" + ASCII_STL, 6.0),
    "u16.stl": (ASCII_STL.encode("utf-16"), 6.0),
    "trailer.stl": (BOX.export(file_type="stl") + b"made by", 6.0),
    "a.dae": (collada(INCH, DAE_TRIANGLES, "<scale>-2 1 1</scale>"), 12.0 * 25.4**3),
    "fans.dae": (collada("", DAE_FANS), 6.0e9),
    "a.zae": (zipped("box.dae", collada(INCH, DAE_TRIANGLES)), 6.0 * 25.4**3),
    "a.amf": (amf("inch", TURNED, MODIFIER), 6.0 * 25.4**3),
    "zipped.amf": (zipped("box.amf", amf("millimeter")), 6.0),
    "a.gltf": (gltf(), 6.0),
    "strip.gltf": (gltf(5, extensionsRequired=["KHR_texture_transform"]), 6.0),
    **dict.fromkeys(
        [f"cases/{n}" for n in ("11_free_format.off", "12_blank_lines.ply", "13_utf16.obj")],
        ("", 6.0),
    ),
}
"""Files of a box of 1 x 2 x 3 and its volume."""


@pytest.mark.parametrize("name", BOXES)
def test_a_box_in_every_notation(tmp_path: Path, name: str) -> None:
    """The probability of a side is its solid angle."""
    content, volume = BOXES[name]
    body = read_body(write(tmp_path, name, content) if content else public_data(name))
    assert len(body.points) == 8
    assert body.triangles is not None
    assert is_closed(body.triangles)
    assert solid_properties(body.points, body.triangles)[0] == pytest.approx(volume)
    assert len(body.notes) == (name == "trailer.stl")
    sides = SIDES * [2, 1, 1] if name == "a.dae" else SIDES
    a, b, c = sides, np.roll(sides, 1), np.roll(sides, 2)
    expected = np.arcsin(b * c / np.sqrt((a**2 + b**2) * (a**2 + c**2))) / np.pi
    found = np.sort(rest_poses(body).probabilities)
    np.testing.assert_allclose(found, np.sort(np.repeat(expected, 2)), atol=1e-6)


def test_quantized_points_are_fractions(tmp_path: Path) -> None:
    """Points as signed fractions of 127, written by pygltflib, in a node of half the size."""
    data = np.rint(POINTS / 1.5 * 127.0).astype("<i1")
    rows = np.pad(data, ((0, 0), (0, 1))).tobytes() + TRIANGLES.astype("<u4").tobytes()
    document = pygltflib.GLTF2(
        extensionsUsed=["KHR_mesh_quantization"],
        extensionsRequired=["KHR_mesh_quantization"],
        nodes=[pygltflib.Node(mesh=0, scale=[0.5, 0.5, 0.5])],
        meshes=[
            pygltflib.Mesh(
                primitives=[
                    pygltflib.Primitive(attributes=pygltflib.Attributes(POSITION=0), indices=1)
                ]
            )
        ],
        accessors=[
            pygltflib.Accessor(
                bufferView=0, componentType=5120, normalized=True, count=8, type="VEC3"
            ),
            pygltflib.Accessor(bufferView=1, componentType=5125, count=36, type="SCALAR"),
        ],
        bufferViews=[
            pygltflib.BufferView(buffer=0, byteLength=32, byteStride=4),
            pygltflib.BufferView(buffer=0, byteOffset=32, byteLength=144),
        ],
        buffers=[pygltflib.Buffer(byteLength=len(rows))],
    )
    document.set_binary_blob(rows)
    document.save_binary(str(tmp_path / "a.glb"))
    points = read_body(tmp_path / "a.glb").points
    assert points.max(axis=0) == pytest.approx(0.5 * np.rint(SIDES / 3.0 * 127.0) / 127.0)


@pytest.mark.parametrize(
    "uri", ["../a.bin", "/dev/zero", "file:///a.bin", "http://localhost/a.bin", "pipe", "none.bin"]
)
def test_data_elsewhere_is_refused_at_once(tmp_path: Path, uri: str) -> None:
    (tmp_path / "a.bin").write_bytes(bytes(168))
    (tmp_path / "below").mkdir()
    os.mkfifo(tmp_path / "below" / "pipe")
    text = gltf(buffers=[{"byteLength": 168, "uri": uri}])
    path = write(tmp_path / "below", "a.gltf", text)
    with pytest.raises(MeshFileError, match=re.escape(uri)):
        read_body(path)


def test_data_in_a_file_beside_it(tmp_path: Path) -> None:
    scene = trimesh.Scene(BOX)
    for name, content in scene.export(file_type="gltf").items():
        (tmp_path / name.replace("gltf_buffer", "a b")).write_bytes(
            content.replace(b"gltf_buffer", b"a%20b")
        )
    assert read_body(tmp_path / "model.gltf").points.max(axis=0) == pytest.approx(SIDES / 2.0)


def test_a_loose_part_is_named_and_left_out(tmp_path: Path) -> None:
    hollow = trimesh.creation.box(
        (0.3, 0.4, 0.5), trimesh.transformations.translation_matrix([0.2, 0, 0])
    )
    hollow.invert()
    crumb = trimesh.creation.icosphere(1, radius=0.02).apply_translation([0.0, 0.0, 4.0])
    body = trimesh.util.concatenate([BOX, hollow])
    poses = []
    for mesh in (body, trimesh.util.concatenate([body, crumb])):
        mesh.export(tmp_path / "a.stl")
        poses += [rest_poses(read_body(tmp_path / "a.stl", keep_largest=k)) for k in (False, True)]
    whole, same, spoiled, kept = poses
    assert whole.notes == same.notes == ()
    assert "--largest-part" in " ".join(spoiled.notes)
    assert abs(spoiled.probabilities[0] - whole.probabilities[0]) > 0.01
    for each in (same, kept):
        np.testing.assert_allclose(each.probabilities, whole.probabilities, atol=1e-12)


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
        ("a.stl", "hello world\n", "expected a .stl file, text of solids or"),
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
        ("a.off", off_text("OFF 8 11 0"), "expected the numbers of vertices and faces"),
        ("a.off", off_text("OFF 9 12 0", line=" "), "expected the numbers of vertices and faces"),
        ("a.ply", ply_text(faces=11), "header promises, 8 vertex, 11 face, got other"),
        ("a.ply", ply_text(faces=10**15), "got other content"),
        ("a.ply", mixed_ply("<").replace(b"face 7", b"face 6"), "got other content"),
        ("a.stl", BOX.export(file_type="stl") + BOX.export(file_type="stl")[84:], "of 12 triang"),
        ("a.dae", collada("", DAE_TRIANGLES.replace("12", "11")), "expected a .dae file"),
        ("a.dae", collada("", DAE_TRIANGLES).replace("?>", "?><!DOCTYPE a>"), "a .dae file"),
        ("a.dae", collada("", DAE_TRIANGLES, '<instance_node url="#n"/>'), "nodes within themsel"),
        ("a.amf", amf("furlong"), "expected a .amf file"),
        ("a.gltf", gltf(extensionsRequired=["EXT_mesh_gpu_instancing"]), "'EXT_mesh_gpu_instanc"),
        ("a.gltf", gltf(extensionsRequired=["KHR_draco_mesh_compression"]), "(Draco)"),
        ("a.gltf", gltf(extensionsRequired=["EXT_meshopt_compression"]), "(meshopt)"),
        ("a.gltf", gltf(nodes=[{"children": [0], "mesh": 0}]), "nodes within themselves"),
        ("a.gltf", gltf(bufferViews=[{"buffer": 0, "byteLength": 169}] * 2), "expected a .gltf"),
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


def test_trimesh_neither_loads_manifold3d_nor_takes_it_from_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    manifold3d = importlib.import_module("manifold3d")
    with quiet_trimesh():
        assert importlib.import_module("manifold3d") is manifold3d
    assert sys.modules["manifold3d"] is manifold3d
    monkeypatch.delitem(sys.modules, "manifold3d")
    with quiet_trimesh(), pytest.raises(ImportError):
        importlib.import_module("manifold3d")
    assert "manifold3d" not in sys.modules
