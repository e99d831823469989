"""Files of solids for printing and for other programs; the ending says the format."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.triangles import Surface, join_surfaces
from dicedesign.palette import BLANK, INK, rgb
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.registry import Extension, Registry


def _read(path: Path) -> tuple[Floats, Integers]:
    from dicedesign.geometry.meshes.reading import read_body

    body = read_body(path)
    if body.triangles is None:
        raise InputError(f"{path}: expected triangles, got points alone; write the file again")
    return body.points, body.triangles


@dataclass(frozen=True, eq=False)
class Part(Surface):
    """Body in one material, with or without labels in another color.

    Attributes
    ----------
    points: (n, 3) in mm, z upward; triangles: (t, 3) counter-clockwise seen from outside.
    name: such as "die"; color: "#rrggbb".
    labels: (t,) whether a triangle belongs to a label, or None without labels.
    label_color: "#rrggbb" of these triangles.
    """

    name: str
    color: str
    labels: Booleans | None = None
    label_color: str = INK

    def groups(self) -> list[tuple[str, str, Integers]]:
        """Name, color and triangles (s, 3) of each color of the part."""
        if self.labels is None or not self.labels.any():
            return [(self.name, self.color, self.triangles)]
        return [
            (self.name, self.color, self.triangles[~self.labels]),
            ("labels", self.label_color, self.triangles[self.labels]),
        ]


@dataclass(frozen=True, eq=False)
class Contents:
    """Content of a file.

    Attributes
    ----------
    title: name of the die.
    parts: at least one, all in one coordinate system.
    facts: texts by name, such as Target, for formats that can hold them.
    unit: of lengths, for formats with comments.
    is_plate: whether each part is a body to print, and an item of its own in 3MF.
    """

    title: str
    parts: Sequence[Part]
    facts: Mapping[str, str] = field(default_factory=dict)
    unit: str = "millimeters"
    is_plate: bool = False

    def materials(self) -> list[tuple[str, str]]:
        """Unique names and colors of the groups of all parts."""
        groups = (group for part in self.parts for group in part.groups())
        return list(dict.fromkeys((name, color) for name, color, _ in groups))


@dataclass(frozen=True, kw_only=True)
class FileFormat(Extension):
    """File format; `name` is the ending of its files without the point.

    Attributes
    ----------
    unit: of lengths, "mm" or "m"; upward: axis of the file along the die's z, "z" or "y".
    precision: of coordinates, "float32" or "float64".
    carries: content of a file beside the solid, in words.
    write: returns the content of a file, deterministically.
    read: returns points (n, 3) and triangles (t, 3) of a file, in its own unit and axes, if
        possible by code independent of the writer.
    """

    write: Callable[[Contents], bytes]
    unit: str = "mm"
    upward: str = "z"
    precision: str = "float64"
    carries: str = "nothing else"
    read: Callable[[Path], tuple[Floats, Integers]] = _read

    @property
    def frame(self) -> Floats:
        """(3, 3) from mm with z upward to the unit and axes of the file."""
        turn = np.eye(3) if self.upward == "z" else np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        return {"mm": 1.0, "m": 1e-3}[self.unit] * turn

    @property
    def same_probabilities(self) -> float:
        """Largest difference between the probabilities of a file and of its solid."""
        return 1e-6 if self.precision == "float32" else 1e-9

    def read_back(self, path: Path) -> tuple[Floats, Integers]:
        """Points (n, 3) in mm, z upward, and triangles (t, 3) of a file. Raises MeshFileError."""
        points, triangles = self.read(path)
        return points @ np.linalg.inv(self.frame).T, triangles


def rows(form: str, values: Floats | Integers) -> str:
    """Format each row (n, k) of numbers, with all digits.

    form: such as "v {!r} {!r} {!r}\\n", with k places.
    """
    return "".join(form.format(*row) for row in values.tolist())


STL = FileFormat(
    name="stl",
    line="binary STL, which every printing program takes",
    precision="float32",
    write=lambda contents: stl_bytes(join_surfaces(*contents.parts)),
)


PACKAGES = "http://schemas.openxmlformats.org/package/2006"
"""Prefix of the namespaces of the Open Packaging Conventions."""

PRINTING = "http://schemas.microsoft.com/3dmanufacturing"
"""Prefix of the namespaces of 3MF."""

KNOWN_FACTS = ("Title", "Application", "Description")
"""Names of facts that 3MF defines; others are in a namespace of this package."""

MODEL = "3D/3dmodel.model"
"""Path of the solid in a 3MF file."""

TYPES = (
    f'<Types xmlns="{PACKAGES}/content-types">'
    f'<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships'
    '+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-'
    '3dmodel+xml"/></Types>'
)

RELATIONS = (
    f'<Relationships xmlns="{PACKAGES}/relationships">'
    f'<Relationship Target="/{MODEL}" Id="solid" Type="{PRINTING}/2013/01/3dmodel"/>'
    "</Relationships>"
)


def three_mf(contents: Contents) -> bytes:
    """Write 3MF: an object for each part, colors of triangles, and one item to print that holds all
    parts, or on a plate an item for each."""
    import zipfile

    # Number 1 is the list of materials.
    materials, objects = contents.materials(), ""
    for number, part in enumerate(contents.parts, 2):
        corners, faces = rows('<vertex x="{!r}" y="{!r}" z="{!r}"/>', part.points), ""
        for name, color, triangles in part.groups():
            paint = f'pid="1" p1="{materials.index((name, color))}"'
            faces += rows(f'<triangle v1="{{}}" v2="{{}}" v3="{{}}" {paint}/>', triangles)
        own = f'pid="1" pindex="{materials.index((part.name, part.color))}"'
        objects += (
            f'<object id="{number}" type="model" name="{_escape(part.name)}" {own}><mesh>'
            f"<vertices>{corners}</vertices><triangles>{faces}</triangles></mesh></object>"
        )
    items = range(2, number + 1)
    if len(items) > 1 and not contents.is_plate:
        components = "".join(f'<component objectid="{k}"/>' for k in items)
        items = range(number + 1, number + 2)
        objects += (
            f'<object id="{items[0]}" type="model" name="{_escape(contents.title)}"><components>'
            f"{components}</components></object>"
        )
    build = "".join(f'<item objectid="{k}"/>' for k in items)
    bases = "".join(
        f'<base name="{_escape(name)}" displaycolor="{_escape(color.upper())}"/>'
        for name, color in materials
    )
    facts = "".join(
        f'<metadata name="{"" if name in KNOWN_FACTS else "die:"}{name}" preserve="1">'
        f"{_escape(text)}</metadata>"
        for name, text in {"Title": contents.title, **contents.facts}.items()
    )
    model = (
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{PRINTING}/core/2015/02" '
        f'xmlns:die="urn:dicedesign:die">{facts}<resources><basematerials id="1">{bases}'
        f"</basematerials>{objects}</resources><build>{build}</build></model>"
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, text in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            (MODEL, model),
        ):
            text = f'<?xml version="1.0" encoding="UTF-8"?>\n{text}'
            # The default time, 1980, makes files reproducible.
            archive.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def _escape(text: str) -> str:
    """Escape a text for XML. lib3mf reads no numeric references, such as `&#39;`."""
    return escape(text, {'"': "&quot;"})


THREE_MF = FileFormat(
    name="3mf",
    line="3MF, the printers' own format, with labels in a color of their own",
    carries="name, parts, colors, target, probabilities, recipe, checksum",
    write=three_mf,
)


ROUGHNESS = 0.6
"""Roughness of a die's surface: between a mirror, 0, and chalk, 1."""


def glb(contents: Contents) -> bytes:
    """Write GLB: a node for each part, a material for each of its colors. Viewers must show faces
    without normals flat."""
    data, materials = b"", contents.materials()
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    for part in contents.parts:
        primitives = []
        places = (part.points @ GLB.frame.T).astype("<f4")
        for name, color, triangles in part.groups():
            number = len(accessors)
            primitives.append(
                {"attributes": {"POSITION": number}, "material": materials.index((name, color))}
            )
            corners = places[triangles].reshape(-1, 3)
            view = {"buffer": 0, "byteOffset": len(data), "byteLength": corners.nbytes}
            views.append(view | {"target": 34962})  # vertices
            accessors.append(
                {
                    "bufferView": number,
                    "componentType": 5126,  # float32
                    "type": "VEC3",
                    "count": len(corners),
                    "min": corners.min(axis=0).tolist(),
                    "max": corners.max(axis=0).tolist(),
                }
            )
            data += corners.tobytes()
        meshes.append({"name": part.name, "primitives": primitives})
    scene = {
        "asset": {"version": "2.0", "generator": "dicedesign", "extras": dict(contents.facts)},
        "scene": 0,
        "scenes": [{"name": contents.title, "nodes": list(range(len(meshes)))}],
        "nodes": [{"name": mesh["name"], "mesh": k} for k, mesh in enumerate(meshes)],
        "meshes": meshes,
        "materials": [_material(*material) for material in materials],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    body = b""
    for mark, chunk in (
        (b"JSON", json.dumps(scene, separators=(",", ":")).encode()),
        (b"BIN\0", data),
    ):
        # Chunks are multiples of four bytes, as positions are.
        chunk += b" " * (-len(chunk) % 4)
        body += struct.pack("<I", len(chunk)) + mark + chunk
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _material(name: str, color: str) -> dict[str, Any]:
    """Material of a color, converted from sRGB to linear light."""
    shown = rgb([color])[0]
    light = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    factors = {
        "baseColorFactor": [*np.round(light, 6).tolist(), 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": ROUGHNESS,
    }
    return {"name": name, "pbrMetallicRoughness": factors}


GLB = FileFormat(
    name="glb",
    line="GLB, which web pages and game engines show",
    unit="m",
    upward="y",
    precision="float32",
    carries="name, parts, colors, target, probabilities, recipe, checksum",
    write=glb,
)


def obj(contents: Contents) -> bytes:
    """Write Wavefront OBJ: an object for each part, a group for each of its colors."""
    text, first = f"# {contents.title}, lengths in {contents.unit}, z upward\n", 1
    for part in contents.parts:
        text += f"o {part.name}\n" + rows("v {!r} {!r} {!r}\n", part.points)
        for name, _, triangles in part.groups():
            text += f"g {name}\n" + rows("f {} {} {}\n", triangles + first)
        first += len(part.points)
    return text.encode()


OBJ = FileFormat(
    name="obj",
    line="Wavefront OBJ, for every program of three dimensions, all digits as text",
    carries="parts; labels as a group",
    write=obj,
)


FILE_FORMATS = Registry(
    "file format",
    FileFormat,
    builtin=(STL, THREE_MF, OBJ, GLB),
    group="dicedesign.file_formats",
)
"""All formats of solids."""


def save_contents(path: Path, contents: Contents) -> None:
    """Write a file, whole or not at all; its ending says the format.

    path: in an existing folder. Raises OutputError if the file cannot be written, else as
    `mesh_bytes`.
    """
    kind = format_of_ending(path.suffix, str(path))
    atomic_write(path, file_bytes(contents, kind, str(path)))


def mesh_bytes(points: Floats, triangles: Integers, ending: str, name: str = "mesh file") -> bytes:
    """Content of a mesh file, deterministic.

    Parameters
    ----------
    points: (n, 3) in mm.
    triangles: (t, 3) in [0, n), counter-clockwise seen from outside.
    ending: "." and the name of a format of `FILE_FORMATS`, in upper or lower case.
    name: of the file in messages.

    Raises
    ------
    InputError: an unknown ending; a coordinate that is not finite in the format's precision.
    """
    contents = Contents("die", [Part(points, triangles, "die", BLANK)])
    return file_bytes(contents, format_of_ending(ending, name), name)


def format_of_ending(ending: str, name: str = "mesh file") -> FileFormat:
    """Format of an ending, "." and its name. Raises InputError if there is none.

    name: of the file in messages.
    """
    if ending[:1] != "." or ending[1:].lower() not in FILE_FORMATS:
        endings = ", ".join(f".{known}" for known in FILE_FORMATS.names)
        raise InputError(
            f"{name}: expected a file ending out of {endings}, got {ending!r}; choose one of them"
        )
    return FILE_FORMATS[ending[1:].lower()]


def with_stl(names: Sequence[str], key: str = "files") -> list[str]:
    """Unique names of formats, STL first. Raises InputError for an unknown format.

    key: option in messages.
    """
    for name in names:
        if name not in FILE_FORMATS:
            raise InputError(
                f"{key}: expected formats out of {', '.join(FILE_FORMATS.names)}, got {name!r}; "
                "choose among them"
            )
    return list(dict.fromkeys(["stl", *names]))


def file_bytes(contents: Contents, kind: FileFormat, name: str = "mesh file") -> bytes:
    """Content of a file in a format, deterministic. Raises as `mesh_bytes`.

    name: of the file in messages.
    """
    for part in contents.parts:
        with np.errstate(over="ignore"):
            finite = np.isfinite(part.points.astype(kind.precision)).all(axis=1)
        if not finite.all():
            row = int(np.argmin(finite))
            raise InputError(
                f"{name}: expected coordinates that are finite in {kind.precision}, got "
                f"{part.points[row].tolist()} in row {row}; repair or scale the solid"
            )
    return kind.write(contents)
