"""OFF, the plainest format of meshes."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Sequence
from html import escape as escaped
from typing import Any, Final

import numpy as np

from dicedesign.fabricate.file_formats import Contents, FileFormat, Part, joined
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.runtime.arrays import Floats, Integers


def rows(form: str, values: Floats | Integers) -> str:
    """A text for each row (n, k) of numbers, with all their digits.

    form: such as "v {!r} {!r} {!r}\\n", with a place for each of the k numbers.
    """
    return "".join(form.format(*row) for row in values.tolist())


def stl(contents: Contents) -> bytes:
    """Contents as binary STL. Triangles whose corners round together are left out."""
    return stl_bytes(*joined(contents.parts))


STL: Final = FileFormat(
    name="stl",
    line="binary STL, which every printing program takes",
    precision="float32",
    write=stl,
)


EARLIEST: Final = (1980, 1, 1, 0, 0, 0)
"""Time of all parts of a ZIP archive, the first that it can hold: the same solid is the same file
at any time."""

PACKAGES: Final = "http://schemas.openxmlformats.org/package/2006"
"""Start of the namespaces of the packages that 3MF files are."""

PRINTING: Final = "http://schemas.microsoft.com/3dmanufacturing"
"""Start of the namespaces of 3MF."""

OWN: Final = "urn:dicedesign:die"
"""Namespace of facts that 3MF has no name for."""

KNOWN_FACTS: Final = frozenset({"Application", "Description"})
"""Facts that it has a name for, beside the title."""

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

MATERIALS: Final = 1
"""Number of the list of materials; objects are counted from the next on."""


def three_mf(contents: Contents) -> bytes:
    """Contents as a 3MF file: an object for each part, the colours of its triangles, and one thing
    to print that holds them all."""
    import zipfile

    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            (MODEL, _model(contents)),
        ):
            part = zipfile.ZipInfo(name, EARLIEST)
            part.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(part, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}')
    return file.getvalue()


def _escape(text: str) -> str:
    """A text within XML. References by numbers, as of an apostrophe, are more than lib3mf reads."""
    return escaped(text, quote=False).replace('"', "&quot;")


def _model(contents: Contents) -> str:
    groups = [group for part in contents.parts for group in part.groups()]
    materials = list(dict.fromkeys((name, color) for name, color, _ in groups))
    bases = "".join(
        f'<base name="{_escape(name)}" displaycolor="{_escape(color.upper())}"/>'
        for name, color in materials
    )
    numbers = range(MATERIALS + 1, MATERIALS + 1 + len(contents.parts))
    objects = "".join(
        _object(part, number, materials)
        for part, number in zip(contents.parts, numbers, strict=True)
    )
    thing = numbers[-1]
    if len(contents.parts) > 1:
        thing += 1
        components = "".join(f'<component objectid="{number}"/>' for number in numbers)
        objects += (
            f'<object id="{thing}" type="model" name="{_escape(contents.title)}"><components>'
            f"{components}</components></object>"
        )
    return (
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{PRINTING}/core/2015/02" '
        f'xmlns:die="{OWN}">{_metadata(contents)}<resources><basematerials id="{MATERIALS}">'
        f'{bases}</basematerials>{objects}</resources><build><item objectid="{thing}"/></build>'
        "</model>"
    )


def _metadata(contents: Contents) -> str:
    facts = {"Title": contents.title}
    for name, text in contents.facts.items():
        facts[name if name in KNOWN_FACTS else f"die:{name}"] = text
    return "".join(
        f'<metadata name="{name}" preserve="1">{_escape(text)}</metadata>'
        for name, text in facts.items()
    )


def _object(part: Part, number: int, materials: Sequence[tuple[str, str]]) -> str:
    """An object with a material, and the others of its triangles."""
    own, *others = [
        (materials.index((name, color)), triangles) for name, color, triangles in part.groups()
    ]
    faces = rows('<triangle v1="{}" v2="{}" v3="{}"/>', own[1])
    for material, triangles in others:
        form = f'<triangle v1="{{}}" v2="{{}}" v3="{{}}" pid="{MATERIALS}" p1="{material}"/>'
        faces += rows(form, triangles)
    corners = rows('<vertex x="{!r}" y="{!r}" z="{!r}"/>', part.points)
    return (
        f'<object id="{number}" type="model" name="{_escape(part.name)}" pid="{MATERIALS}" '
        f'pindex="{own[0]}"><mesh><vertices>{corners}</vertices><triangles>{faces}</triangles>'
        "</mesh></object>"
    )


THREE_MF: Final = FileFormat(
    name="3mf",
    line="3MF, the printers' own format, with labels in a colour of their own",
    carries="name, parts, colours, target, odds, recipe, checksum",
    write=three_mf,
)


MAGIC: Final = b"glTF"

VERSION: Final = 2

FLOAT: Final = 5126
"""Number of the type float32."""

VERTICES: Final = 34962
"""Number of buffers of vertices."""

ROUGHNESS: Final = 0.6
"""Of the surface of a die: between a mirror, 0, and chalk, 1."""


def glb(contents: Contents) -> bytes:
    """Contents as GLB: a node for each part, a material for each colour of one. Faces are flat, as
    programs have to show those without normals."""
    data = b""
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    materials: dict[tuple[str, str], int] = {}
    meshes = []
    for part in contents.parts:
        primitives = []
        places = (part.points @ GLB.frame.T).astype("<f4")
        for name, color, triangles in part.groups():
            corners = places[triangles].reshape(-1, 3)
            place = {"buffer": 0, "byteOffset": len(data), "byteLength": corners.nbytes}
            views.append({**place, "target": VERTICES})
            bounds = {"min": corners.min(axis=0).tolist(), "max": corners.max(axis=0).tolist()}
            kind = {"componentType": FLOAT, "type": "VEC3", "count": len(corners)}
            accessors.append({"bufferView": len(accessors), **kind, **bounds})
            data += corners.tobytes()
            number = materials.setdefault((name, color), len(materials))
            attributes = {"POSITION": len(accessors) - 1}
            primitives.append({"attributes": attributes, "material": number})
        meshes.append({"name": part.name, "primitives": primitives})
    scene = {
        "asset": {"version": "2.0", "generator": "dicedesign", "extras": dict(contents.facts)},
        "scene": 0,
        "scenes": [{"name": contents.title, "nodes": list(range(len(meshes)))}],
        "nodes": [{"name": mesh["name"], "mesh": k} for k, mesh in enumerate(meshes)],
        "meshes": meshes,
        "materials": [_material(name, color) for name, color in materials],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode()
    body = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", data, b"\0")
    return MAGIC + struct.pack("<II", VERSION, 12 + len(body)) + body


def _material(name: str, color: str) -> dict[str, Any]:
    """A material; `color`, in sRGB, becomes one in amounts of light."""
    shown = np.array([int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)])
    light = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    factors = {
        "baseColorFactor": [*np.round(light, 6).tolist(), 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": ROUGHNESS,
    }
    return {"name": name, "pbrMetallicRoughness": factors}


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    """A chunk, filled up to a multiple of four bytes."""
    filled = data + filler * (-len(data) % 4)
    return struct.pack("<I", len(filled)) + kind + filled


GLB: Final = FileFormat(
    name="glb",
    line="GLB, which web pages and game engines show",
    unit="m",
    upward="y",
    precision="float32",
    carries="name, parts, colours, target, odds, recipe, checksum",
    write=glb,
)


def obj(contents: Contents) -> bytes:
    """Contents as Wavefront OBJ: an object for each part, and a group for each colour of one."""
    text, first = f"# {contents.title}, lengths in {contents.unit}, z upward\n", 1
    for part in contents.parts:
        text += f"o {part.name}\n" + rows("v {!r} {!r} {!r}\n", part.points)
        for name, _, triangles in part.groups():
            text += f"g {name}\n" + rows("f {} {} {}\n", triangles + first)
        first += len(part.points)
    return text.encode()


OBJ: Final = FileFormat(
    name="obj",
    line="Wavefront OBJ, for every program of three dimensions, all digits as text",
    carries="parts; labels as a group",
    write=obj,
)


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


PLY: Final = FileFormat(
    name="ply",
    line="binary PLY, small, all digits",
    write=ply,
)


def off(contents: Contents) -> bytes:
    """Contents as ASCII OFF."""
    points, triangles = joined(contents.parts)
    text = rows("{!r} {!r} {!r}\n", points) + rows("3 {} {} {}\n", triangles)
    return f"OFF\n{len(points)} {len(triangles)} 0\n{text}".encode()


OFF: Final = FileFormat(
    name="off",
    line="OFF, the plainest format of programs for geometry, all digits as text",
    write=off,
)
