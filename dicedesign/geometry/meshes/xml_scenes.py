"""Parsers of COLLADA and AMF files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.geometry.meshes.parsing import Geometry, fans
from dicedesign.geometry.meshes.scenes import (
    Node,
    quaternion_matrix,
    triangles_of,
    used_part,
    walk,
)
from dicedesign.geometry.meshes.xml_files import scene_root
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


def _floats(element: Element | None, count: int) -> Floats:
    """(count,) numbers in an element."""
    if element is None:
        raise ValueError
    values = np.array((element.text or "").split(), dtype=np.float64)
    if len(values) != count:
        raise ValueError
    return values


def _ids_of(element: Element) -> dict[str, Element]:
    return {name: each for each in element.iter() if (name := each.get("id"))}


class _Collada:
    """Document of a COLLADA file."""

    def __init__(self, root: Element) -> None:
        self.root = root
        self.ids = _ids_of(root)
        self.meshes = cache(self._meshes)
        self._points = cache(self._read_points)

    def target(self, element: Element, name: str = "url") -> Element:
        """Element that another one names."""
        return self.ids[element.get(name, "").removeprefix("#")]

    def node(self, element: Element) -> Node:
        matrix, children, meshes, is_skewed = np.eye(4), [], [], False
        for child in element:
            own = np.eye(4)
            if child.tag == "matrix":
                own = _floats(child, 16).reshape(4, 4)
            elif child.tag == "translate":
                own[:3, 3] = _floats(child, 3)
            elif child.tag == "scale":
                own[:3, :3] = np.diag(_floats(child, 3))
            elif child.tag == "rotate":
                *axis, angle = _floats(child, 4)
                half = np.radians(angle) / 2.0
                x, y, z = np.sin(half) * np.array(axis) / (np.linalg.norm(axis) or 1.0)
                own[:3, :3] = quaternion_matrix(x, y, z, np.cos(half))
            elif child.tag in ("lookat", "skew"):
                is_skewed = True
            elif child.tag == "node":
                children.append(child)
            elif child.tag == "instance_node":
                children.append(self.target(child))
            elif child.tag == "instance_geometry":
                meshes += self.meshes(self.target(child))
            elif child.tag == "instance_controller":
                children.append(self.target(child))
            elif child.tag in ("skin", "morph"):
                # A controller; bones are at rest.
                bind = child.find("bind_shape_matrix")
                own = np.eye(4) if bind is None else _floats(bind, 16).reshape(4, 4)
                source = self.target(child, "source")
                if source.tag == "geometry":
                    meshes += self.meshes(source)
                else:
                    children.append(source)
            matrix = matrix @ own
        if is_skewed and element.find(".//instance_geometry") is not None:
            raise ValueError
        return Node(matrix, children, meshes)

    def _meshes(self, geometry: Element) -> list[tuple[Floats, Integers]]:
        """Points and triangles of each group of primitives of a geometry."""
        meshes = []
        # Some programs give sources of several geometries one name.
        own = _ids_of(geometry)
        for group in geometry.iterfind("mesh/*"):
            if group.tag not in ("triangles", "polylist", "polygons", "trifans", "tristrips"):
                continue
            inputs = group.findall("input")
            (vertices,) = (each for each in inputs if each.get("semantic") == "VERTEX")
            (position,) = (
                each
                for each in own[vertices.get("source", "")[1:]].iterfind("input")
                if each.get("semantic") == "POSITION"
            )
            width = 1 + max(int(each.get("offset", 0)) for each in inputs)
            corners = [
                np.array((p.text or "").split(), dtype=np.int64).reshape(-1, width)[
                    :, int(vertices.get("offset", 0))
                ]
                for p in group.iter("p")
            ]
            joined = np.concatenate([np.empty(0, dtype=np.int64), *corners])
            sizes = np.array([len(each) for each in corners])
            if group.tag == "triangles":
                sizes = np.full(int(group.get("count", 0)), 3)
            elif group.tag == "polylist":
                sizes = _floats(group.find("vcount"), int(group.get("count", 0))).astype(np.int64)
            if sizes.sum() != len(joined):
                raise ValueError
            triangles = (
                np.concatenate([triangles_of(strip, 5) for strip in corners])
                if group.tag == "tristrips"
                else fans(sizes, joined)
            )
            points = self._points(own[position.get("source", "")[1:]])
            meshes.append(used_part(points, triangles))
        return meshes

    def _read_points(self, source: Element) -> Floats:
        """(n, 3) positions of a source."""
        accessor = source.find("technique_common/accessor")
        array = source.find("float_array")
        if accessor is None or array is None:
            raise ValueError
        numbers = _floats(array, int(array.get("count", 0)))
        stride, count = int(accessor.get("stride", 1)), int(accessor.get("count", 0))
        start = int(accessor.get("offset", 0))
        return numbers[start : start + count * stride].reshape(count, stride)[:, :3]


def parse_collada(data: bytes, path: Path) -> Geometry:
    """Meshes of the scene of a COLLADA file, in mm; bones are at rest.

    Raises MeshFileError or any other exception: it is wrong.
    """
    root = scene_root(data, path, (".dae",))
    collada = _Collada(root)
    scene = root.find("scene/instance_visual_scene")
    roots = (
        root.findall("library_visual_scenes/visual_scene")
        if scene is None
        else [collada.target(scene)]
    )
    geometry = walk(roots, cache(collada.node), path)
    unit = root.find("asset/unit")
    return _scale(geometry, 1e3 * (1.0 if unit is None else float(unit.get("meter", 1.0))))


def _scale(geometry: Geometry, factor: float) -> Geometry:
    # So that 0.001 m is 1 mm exactly.
    return geometry._replace(points=geometry.points * round(factor, 12))


AMF_UNITS = {"millimeter": 1.0, "inch": 25.4, "feet": 304.8, "meter": 1e3, "micron": 1e-3}
"""Lengths of the units of AMF in mm."""


def parse_amf(data: bytes, path: Path) -> Geometry:
    """All objects of an AMF file at the places of its constellations, in mm.

    Support and the modifiers of slicers are left out. Raises MeshFileError or any other exception:
    it is wrong.
    """
    root = scene_root(data, path, (".amf",))
    if root.tag != "amf":
        raise ValueError
    things = {each.get("id", ""): each for each in root if each.tag in ("object", "constellation")}
    meshes = {name: list(_amf_meshes(each)) for name, each in things.items()}
    children = {
        name: [(each.get("objectid", ""), each) for each in thing.iterfind("instance")]
        for name, thing in things.items()
    }

    @cache
    def node_of(place: tuple[str, Element | None]) -> Node:
        name, instance = place
        matrix = np.eye(4)
        if instance is not None:
            shift = [float(instance.findtext(f"delta{axis}", "0")) for axis in "xyz"]
            for axis, turn in enumerate("xyz"):
                half = np.radians(float(instance.findtext(f"r{turn}", "0"))) / 2.0
                x, y, z = np.sin(half) * np.eye(3)[axis]
                own = quaternion_matrix(x, y, z, np.cos(half))
                matrix[:3, :3] = own @ matrix[:3, :3]
            matrix[:3, 3] = shift
        return Node(matrix, children[name], meshes[name])

    placed = {each.get("objectid") for each in root.iter("instance")}
    roots = [(name, None) for name in things if name not in placed]
    return _scale(walk(roots, node_of, path), AMF_UNITS[root.get("unit", "millimeter").lower()])


def _amf_meshes(thing: Element) -> Iterator[tuple[Floats, Integers]]:
    for mesh in thing.iterfind("mesh"):
        points = [
            [float(vertex.findtext(axis, "")) for axis in "xyz"]
            for vertex in mesh.iterfind("vertices/vertex/coordinates")
        ]
        triangles = [
            [int(triangle.findtext(corner, "")) for corner in ("v1", "v2", "v3")]
            for volume in mesh.iterfind("volume")
            if _is_model(volume)
            for triangle in volume.iterfind("triangle")
        ]
        if triangles:
            yield np.array(points).reshape(-1, 3), np.array(triangles, dtype=np.int64)


def _is_model(volume: Element) -> bool:
    facts = {each.get("type"): (each.text or "").strip() for each in volume.iterfind("metadata")}
    return (
        volume.get("type", "object") != "support"
        and facts.get("slic3r.modifier", "0") == "0"
        and facts.get("slic3r.volume_type", "ModelPart") == "ModelPart"
    )
