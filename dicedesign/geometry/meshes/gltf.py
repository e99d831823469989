"""Parser of glTF and GLB files: their meshes as placed in the scene, nothing else."""

from __future__ import annotations

import base64
import json
import re
import struct
from functools import cache
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import MeshFileError
from dicedesign.geometry.meshes.parsing import EXPORT_AGAIN, Geometry
from dicedesign.geometry.meshes.scenes import (
    Node,
    quaternion_matrix,
    triangles_of,
    used_part,
    walk,
)
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import MAX_DATA_BYTES, read_file

COMPRESSED = {
    "KHR_draco_mesh_compression": "Draco",
    "EXT_meshopt_compression": "meshopt",
    "KHR_meshopt_compression": "meshopt",
}
"""Extensions of glTF that hide the points, and what decodes them."""

HARMLESS = re.compile(
    r"KHR_mesh_quantization|[A-Z0-9]+_(materials?|textures?|lights?|xmp|animation|audio|node_"
    r"(visibility|hoverability|selectability)|techniques)(_\w+)?"
)
"""Extensions of glTF that concern the appearance or are read."""

GLTF_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""NumPy's types of the component types of glTF."""

GLTF_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

MAX_JSON_BYTES = 1 << 28
"""Limit of the JSON of a file: 256 MiB."""

MAX_NUMBERS = 1 << 24
"""Limit of the numbers of all accessors of a file; one for each byte of its buffers is allowed
too."""


MATRIX_WIDTH = 16
"""Most numbers of an element of an accessor of matrices."""


def read_beside(path: Path, uri: str) -> bytes:
    """Content of a regular file in the folder of another file, or below it.

    uri: as in a glTF file. Raises MeshFileError: it leads elsewhere, or there is none.
    """
    name = unquote(uri)
    place = PurePosixPath(name)
    if place.is_absolute() or ".." in place.parts or ":" in name or "\\" in name:
        raise MeshFileError(
            f"{path}: expected data in the file or in files beside it, got {uri[:80]!r}; "
            "export it as GLB, which is one file"
        )
    return read_file(path.parent / name, f"data of {path}", error=MeshFileError)


class _Gltf:
    """Document of a glTF file with access to its data."""

    def __init__(self, data: bytes, path: Path) -> None:
        """Raises MeshFileError: it is too large, or needs an extension that is not read."""
        self.path = path
        self.chunk: bytes | None = None
        text = data
        if data[:4] == b"glTF":
            _, version, length = struct.unpack_from("<4sII", data)
            if version != 2 or length > len(data):
                raise ValueError
            chunks: dict[bytes, bytes] = {}
            at = 12
            while at + 8 <= length:
                size, kind = struct.unpack_from("<I4s", data, at)
                if at + 8 + size > length:
                    raise ValueError
                chunks.setdefault(kind, data[at + 8 : at + 8 + size])
                at += 8 + size
            text, self.chunk = chunks[b"JSON"], chunks.get(b"BIN\0")
        if len(text) > MAX_JSON_BYTES:
            raise self.too_large(f"{MAX_JSON_BYTES >> 20} MiB of JSON", len(text) >> 20)
        self.document: dict[str, Any] = json.loads(text)
        if not str(self.document["asset"]["version"]).startswith("2"):
            raise MeshFileError(
                f"{path}: expected glTF 2, got version {self.document['asset']['version']}; "
                f"{EXPORT_AGAIN}"
            )
        self.contents: dict[str, bytes] = {}
        self.array, self.meshes = cache(self._array), cache(self._meshes)
        self.primitive = cache(self._primitive)
        for name in self.document.get("extensionsRequired", []):
            if name in COMPRESSED:
                raise self.compressed(name)
            if not HARMLESS.fullmatch(name):
                raise MeshFileError(
                    f"{path}: expected no extension that is needed to read its shape, got "
                    f"{name[:80]!a}; export it without"
                )
        numbers = sum(
            _index(accessor["count"]) * GLTF_WIDTHS.get(accessor["type"], MATRIX_WIDTH)
            for accessor in self.document.get("accessors", [])
        )
        sizes = [_index(each["byteLength"]) for each in self.document.get("buffers", [])]
        limit = max(MAX_NUMBERS, sum(sizes))
        if numbers > limit:
            raise self.too_large(f"{limit} numbers of its accessors", numbers)

    def too_large(self, most: str, got: int) -> MeshFileError:
        return MeshFileError(f"{self.path}: expected at most {most}, got {got}; {EXPORT_AGAIN}")

    def compressed(self, name: str) -> MeshFileError:
        return MeshFileError(
            f"{self.path}: expected points that are not compressed, got {name} "
            f"({COMPRESSED[name]}); export it without compression, or decode it with "
            "`gltf-transform copy IN OUT`"
        )

    def view(self, number: int) -> memoryview:
        """Content of a buffer view."""
        view = self.document["bufferViews"][_index(number)]
        index = _index(view["buffer"])
        uri = self.document["buffers"][index].get("uri")
        if uri is None:
            if index != 0 or self.chunk is None:
                raise ValueError
            content = self.chunk
        elif uri not in self.contents:
            if uri.startswith("data:"):
                head, _, body = uri.partition(",")
                raw = unquote_to_bytes(body)
                content = base64.b64decode(raw) if head.endswith(";base64") else raw
            else:
                content = read_beside(self.path, uri)
            self.contents[uri] = content
            total = sum(map(len, self.contents.values()))
            if total > MAX_DATA_BYTES:
                raise self.too_large(f"{MAX_DATA_BYTES >> 20} MiB of buffers", total >> 20)
        else:
            content = self.contents[uri]
        start, length = _index(view.get("byteOffset", 0)), _index(view["byteLength"])
        size = self.document["buffers"][index]["byteLength"]
        if size > len(content) or start + length > size:
            raise ValueError
        return memoryview(content)[start : start + length]

    def _array(self, number: int) -> NDArray[Any]:
        """(n, k) numbers of an accessor; normalized integers as the fractions that they mean."""
        accessor = self.document["accessors"][_index(number)]
        count, width = _index(accessor["count"]), GLTF_WIDTHS[accessor["type"]]
        kind = np.dtype(GLTF_TYPES[accessor["componentType"]])
        if "bufferView" in accessor:
            values = self._values(accessor, kind, count, width)
        elif "sparse" in accessor:
            values = np.zeros((count, width), kind)
        else:
            used = COMPRESSED.keys() & set(self.document.get("extensionsUsed", []))
            raise self.compressed(min(used)) if used else ValueError
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            many, where = _index(sparse["count"]), sparse["indices"]
            index_kind = np.dtype(GLTF_TYPES[where["componentType"]])
            places = self._values(where, index_kind, many, 1)[:, 0]
            values = values.copy()
            values[places] = self._values(sparse["values"], kind, many, width)
        if accessor.get("normalized") and kind.kind != "f":
            return np.maximum(values / float(np.iinfo(kind).max), -1.0)
        return values

    def _values(
        self, source: dict[str, Any], kind: np.dtype[Any], count: int, width: int
    ) -> NDArray[Any]:
        content = self.view(source["bufferView"])
        stride = self.document["bufferViews"][source["bufferView"]].get("byteStride")
        strides = stride or kind.itemsize * width, kind.itemsize
        # It checks that the view is as large.
        return np.ndarray(
            (count, width), kind, content, _index(source.get("byteOffset", 0)), strides
        )

    def _meshes(self, number: int) -> list[tuple[Floats, Integers]]:
        """Points and triangles of each primitive of a mesh that has any."""
        meshes = []
        for primitive in self.document["meshes"][_index(number)]["primitives"]:
            mode, accessor = primitive.get("mode", 4), primitive["attributes"].get("POSITION")
            if accessor is not None and mode in (0, 4, 5, 6):
                meshes.append(self.primitive(accessor, primitive.get("indices"), mode))
        return meshes

    def _primitive(self, accessor: int, indices: int | None, mode: int) -> tuple[Floats, Integers]:
        points = self.array(accessor).reshape(-1, 3)
        if indices is None:
            order = np.arange(len(points))
        else:
            order = self.array(indices)[:, 0].astype(np.int64)
        points, triangles = used_part(points, triangles_of(order, mode))
        return points.astype(np.float64), triangles

    def node(self, number: int) -> Node:
        node = self.document["nodes"][_index(number)]
        matrix = np.eye(4)
        if "matrix" in node:
            matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        else:
            matrix[:3, :3] = quaternion_matrix(*map(float, node.get("rotation", (0, 0, 0, 1))))
            matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
            matrix[:3, 3] = node.get("translation", (0, 0, 0))
        return Node(
            matrix, node.get("children", ()), self.meshes(node["mesh"]) if "mesh" in node else ()
        )


def _index(value: Any) -> int:
    """A number from 0 on that is whole."""
    if not isinstance(value, int) or value < 0:
        raise ValueError
    return value


def parse_gltf(data: bytes, path: Path) -> Geometry:
    """Meshes of the scene that a glTF or GLB file shows. Skins and morphs are at rest.

    Raises MeshFileError: it needs an extension or data elsewhere that are not read, or any other
    exception: it is wrong.
    """
    gltf = _Gltf(data, path)
    nodes = gltf.document.get("nodes", [])
    if scenes := gltf.document.get("scenes"):
        roots = scenes[_index(gltf.document.get("scene", 0))].get("nodes", [])
    else:
        children = set(chain.from_iterable(node.get("children", ()) for node in nodes))
        roots = [number for number in range(len(nodes)) if number not in children]
    return walk(roots, cache(gltf.node), path)
