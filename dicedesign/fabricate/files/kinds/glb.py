"""GLB: glTF in one file, which web pages and game engines show.

Source: glTF 2.0 Specification (Khronos Group, 2021), by which lengths are in metres and y is
upward.
"""

from __future__ import annotations

import json
import struct
from typing import Any, Final

import numpy as np

from dicedesign.fabricate.files.file_format import FILE_FORMATS, Contents, FileFormat
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Floats

__all__ = ["glb"]

MAGIC: Final = b"glTF"

VERSION: Final = 2

FLOAT: Final = 5126
"""Number of the type float32."""

VERTICES: Final = 34962
"""Number of buffers of vertices."""

ROUGHNESS: Final = 0.6
"""Of the surface of a die: between a mirror, 0, and chalk, 1."""


def glb(contents: Contents) -> bytes:
    """Contents as GLB: a node for each part, a material for each colour of one, flat faces."""
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
            for kind, values in (("POSITION", corners), ("NORMAL", _flat_normals(corners))):
                view = {"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes}
                views.append({**view, "target": VERTICES})
                accessor = {"bufferView": len(views) - 1, "componentType": FLOAT, "type": "VEC3"}
                accessor["count"] = len(values)
                if kind == "POSITION":
                    accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
                accessors.append(accessor)
                data += values.tobytes()
            number = materials.setdefault((name, color), len(materials))
            attributes = {"POSITION": len(accessors) - 2, "NORMAL": len(accessors) - 1}
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


def _flat_normals(corners: Floats) -> Floats:
    """Unit normals (3 t, 3) of triangles at each of their corners (3 t, 3); of those without area
    any."""
    doubled = doubled_area_vectors(
        corners.astype(np.float64), np.arange(len(corners)).reshape(-1, 3)
    )
    lengths = np.linalg.norm(doubled, axis=1, keepdims=True)
    normals = np.broadcast_to([0.0, 1.0, 0.0], doubled.shape).copy()
    np.divide(doubled, lengths, out=normals, where=lengths > 0.0)
    return normals.repeat(3, axis=0).astype("<f4")


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


GLB: Final = FILE_FORMATS.register(
    FileFormat(
        name="glb",
        line="GLB, which web pages and game engines show",
        rank=40,
        unit="m",
        upward="y",
        precision="float32",
        carries="name, parts, colours, target, odds, recipe, checksum",
        write=glb,
    )
)
