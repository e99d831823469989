"""Small files that take hours or gigabytes where a reader does not count first."""

from __future__ import annotations

import base64
import io
import json
import struct
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

LAUGHS = '<!DOCTYPE a [<!ENTITY a "ha">{}]>'.format(
    "".join(f'<!ENTITY {chr(98 + k)} "{10 * f"&{chr(97 + k)};"}">' for k in range(9))
)
"""Entities that stand for gigabytes as "&j;"."""

PLY = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
)

OFF_POINTS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"

LINK = "<robot><link name='a'>{}</link></robot>"

SPHERE = "<collision><geometry><sphere radius='1'/></geometry></collision>"

MJCF = "<mujoco>{}<worldbody><body><geom size='1'/></body></worldbody></mujoco>"


def zipped(parts: Mapping[str, str], kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Archive of texts."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as archive:
        for name, text in parts.items():
            archive.writestr(name, text)
    return file.getvalue()


def gltf(points: int = 4, **entries: Any) -> str:
    """Document of a triangle and further points, with other entries."""
    raw = struct.pack(f"<{3 * points}f", *range(3 * points)) + struct.pack("<3I", 0, 1, 2)
    document = {
        "asset": {"version": "2.0"},
        "buffers": [
            {"uri": f"data:;base64,{base64.b64encode(raw).decode()}", "byteLength": len(raw)}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 12 * points},
            {"buffer": 0, "byteOffset": 12 * points, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": points, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
    }
    return json.dumps({**document, **entries})


def amf(objects: str, tail: str = "") -> str:
    """AMF file of an object with a mesh of 4 points and 2000 triangles."""
    point = "<vertex><coordinates><x>{}</x><y>{}</y><z>{}</z></coordinates></vertex>"
    points = "".join(point.format(*line.split()) for line in OFF_POINTS.splitlines())
    triangles = 2000 * "<triangle><v1>0</v1><v2>1</v2><v3>2</v3></triangle>"
    mesh = f"<mesh><vertices>{points}</vertices><volume>{triangles}</volume></mesh>"
    return f"<amf><object id='o'>{mesh}</object>{objects}{tail}</amf>"


def collada(groups: int, numbers: int) -> str:
    """COLLADA file of groups of one triangle that share one array."""
    triangle = '<triangles count="1"><input semantic="VERTEX" source="#v"/><p>0 1 2</p></triangles>'
    array = f'<float_array count="{numbers}">{numbers * "1 "}</float_array>'
    accessor = f'<accessor count="{numbers // 3}" stride="3"/>'
    source = f'<source id="s">{array}<technique_common>{accessor}</technique_common></source>'
    points = f'{source}<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>'
    mesh = f'<geometry id="g"><mesh>{points}{groups * triangle}</mesh></geometry>'
    scene = '<visual_scene id="w"><node><instance_geometry url="#g"/></node></visual_scene>'
    return (
        f"<COLLADA><library_geometries>{mesh}</library_geometries><library_visual_scenes>{scene}"
        '</library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>'
    )


MESHES: dict[str, Callable[[], str | bytes]] = {
    "newlines.ply": lambda: "ply" + 400_000 * "\n",
    "header.ply": lambda: "ply\n" + 300_000 * "comment\n",
    "long_word.ply": lambda: (
        PLY.format("ascii", 9) + "end_header\n" + 200_000 * "1" + 99_999 * " 2"
    ),
    "vertices.ply": lambda: PLY.format("ascii", 4 * 10**9) + "end_header\n0 0 0\n",
    "list.ply": lambda: (
        PLY.format("binary_little_endian", 1).encode()
        + b"property list uint float w\nend_header\n"
        + 12 * b"\0"
        + 900 * b"\xff"
    ),
    "blank.stl": lambda: 400_000 * "\n",
    "triangles.stl": lambda: 80 * b"\0" + 4 * b"\xff" + 99 * b"\0",
    "continued.obj": lambda: 600_000 * "v 1\\\n",
    "vertices.off": lambda: "OFF\n2000000000 1 0\n0 0 0\n",
    "negative.off": lambda: "OFF\n4 2000000000 0\n" + OFF_POINTS + "-1\n",
    "sides.off": lambda: "OFF\n4 1 0\n" + OFF_POINTS + "2000000000 1 2 3\n",
    "digits.xyz": lambda: 1_000_000 * "1" + " 0 0\n",
    "tags.amf": lambda: zipped({"a.amf": f"<amf>{20_000_000 * '<a/>'}</amf>"}),
    "nested.amf": lambda: amf(
        "".join(
            f"<constellation id='{k}'>{2 * f'<instance objectid={chr(39)}{k + 1}{chr(39)}/>'}"
            "</constellation>"
            for k in range(60)
        ),
        "<constellation id='60'><instance objectid='o'/></constellation>",
    ),
    "repeated.amf": lambda: amf(
        f"<constellation id='c'>{9000 * '<instance objectid={}/>'.format(chr(39) + 'o' + chr(39))}"
        "</constellation>"
    ),
    "laughs.amf": lambda: LAUGHS + "<amf>&j;</amf>",
    "spaces.zae": lambda: zipped({"a.dae": f"<COLLADA>{' ' * (60 << 20)}</COLLADA>"}),
    "groups.dae": lambda: collada(2000, 300_000),
    "spaces.3mf": lambda: zipped({"3D/3dmodel.model": f"<model>{' ' * (60 << 20)}"}),
    "laughs.3mf": lambda: zipped({"3D/3dmodel.model": f"{LAUGHS}<model>&j;</model>"}),
    "count.gltf": lambda: gltf(accessors=[{"componentType": 5126, "count": 10**9, "type": "VEC4"}]),
    "repeated.gltf": lambda: gltf(
        30_000, meshes=[{"primitives": 500 * [{"attributes": {"POSITION": 0}, "mode": 0}]}]
    ),
    "doubled.gltf": lambda: gltf(
        nodes=[{"children": [k + 1, k + 1]} for k in range(60)] + [{"mesh": 0}]
    ),
    "deep.gltf": lambda: '{"asset": ' + 500_000 * "[",
}
"""Mesh files by name."""

ROBOTS: dict[str, Callable[[], str]] = {
    "tags.urdf": lambda: LINK.format(1_100_000 * "<a/>"),
    "shapes.urdf": lambda: LINK.format(1100 * SPHERE),
    "attributes.urdf": lambda: f"<robot {' '.join(f'a{k}=' + 2 * chr(39) for k in range(999))}/>",
    "laughs.urdf": lambda: LAUGHS + "<robot>&j;</robot>",
    "itself.xml": lambda: MJCF.format(2 * "<include file='itself.xml'/>"),
    "included.xml": lambda: MJCF.format(5 * "<include file='large.xml'/>"),
}
"""Robots by name."""

INCLUDED = f"<mujoco>{250_000 * '<a/>'}</mujoco>"
"""The file large.xml."""
