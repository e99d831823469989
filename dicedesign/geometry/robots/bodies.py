"""Bodies of a file: that of a mesh file, or the links of a robot (URDF, MJCF), each in its own
frame and in meters.

A link has the shapes that collide, or else those that are shown. Its center of mass is that of its
inertial frame, or of its shapes. Joints do not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import InputError, MeshFileError, named
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import MILLIMETER_ENDINGS, THREE_MF, read_body
from dicedesign.geometry.robots.links import (
    Attributes,
    NamedBody,
    Shape,
    gather_shapes,
    inertial_frame,
    make_link,
    mesh_shape,
    numbers,
    parse_xml,
    primitive_shape,
)
from dicedesign.geometry.robots.mjcf import MjcfModel
from dicedesign.geometry.sphere import rigid_motion
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

ROBOT_ENDINGS = frozenset([".urdf", ".xml", ".mjcf"])


def list_bodies(path: Path, item: int | None = None, keep_largest: bool = False) -> list[NamedBody]:
    """Bodies of a mesh file, of which a 3MF file may have several, or of a robot. Links without
    shapes are left out. A file that cannot be read is one body, which raises when it is read.

    item, keep_largest: of a mesh file, see `read_body`.
    """
    suffix = path.suffix.lower()
    if item is not None or keep_largest or suffix not in (*ROBOT_ENDINGS, THREE_MF):
        return [NamedBody("", partial(read_body, path, item, keep_largest=keep_largest))]

    def fail(error: Exception) -> Body:
        raise error

    try:
        return _list_items(path) if suffix == THREE_MF else _list_links(path)
    except Exception as error:
        return [NamedBody("", partial(fail, error))]


def _list_items(path: Path) -> list[NamedBody]:
    # Other files need no XML.
    from dicedesign.geometry.meshes.three_mf import Build

    build = Build(path)
    if len(build.items) < 2:
        return [NamedBody("", build.body)]
    count = len(build.items)
    return [NamedBody(f"item {k}", partial(build.body, k)) for k in range(1, count + 1)]


def _list_links(path: Path) -> list[NamedBody]:
    root, read_mesh = parse_xml(path), cache(_read_in_meters)
    if root.tag not in ("robot", "mujoco"):
        raise MeshFileError(
            f"{path}: expected robot (URDF) or mujoco (MJCF) as root element, got "
            f"{root.tag[:40]!a}; name a robot"
        )
    with named(str(path)):
        if root.tag == "robot":
            links = list(_urdf_links(path, root, read_mesh))
        else:
            links = MjcfModel(path, root, read_mesh).links()
        if not links:
            raise InputError("expected a link with shapes, found none; add a shape")
    return links


def _read_in_meters(path: Path) -> Body:
    """Body of a mesh file that has the unit of the robot, unless its format says its own."""
    body = read_body(path)
    if path.suffix.lower() not in MILLIMETER_ENDINGS:
        return body
    return replace(body, points=1e-3 * body.points)


def _urdf_links(
    path: Path, root: Element, read_mesh: Callable[[Path], Body]
) -> Iterator[NamedBody]:
    def attributes(element: Element, child: str) -> Attributes:
        return {} if (found := element.find(child)) is None else found.attrib

    def motion(element: Element) -> Floats:
        # Mesh files do without this.
        from scipy.spatial.transform import Rotation

        origin = attributes(element, "origin")
        turn = Rotation.from_euler("xyz", numbers(origin, "rpy", "0 0 0")).as_matrix()
        return rigid_motion(turn, numbers(origin, "xyz", "0 0 0"))

    def file(name: str) -> Path:
        """File of a mesh; a package may be any folder above, or a folder in one of these."""
        package, _, within = name.removeprefix("package://").partition("/")
        if not name.startswith("package://"):
            return path.parent / name.removeprefix("file://")
        above = path.resolve().parents
        places = [
            place for folder in above for place in (folder / package / within, folder / within)
        ]
        return next((place for place in places if place.is_file()), path.parent / within)

    def shape(element: Element) -> Shape:
        geometry = element.find("geometry")
        if geometry is None or len(geometry) != 1:
            raise InputError(f"{element.tag}: expected one geometry with a shape; add it")
        of, kind = geometry[0].attrib, geometry[0].tag
        if kind == "mesh":
            scale = numbers(of, "scale", "1 1 1")
            return mesh_shape(read_mesh(file(of.get("filename", ""))), scale, motion(element))
        if kind == "box":
            return primitive_shape(kind, 0.5 * numbers(of, "size", ""), motion(element))
        if kind not in ("cylinder", "capsule", "sphere"):
            raise InputError(
                f"geometry: expected mesh, box, cylinder, capsule or sphere, got {kind[:40]!a}; "
                "take one of these"
            )
        size = np.repeat(numbers(of, "radius", "", 1), 3)
        if kind != "sphere":
            size[2:] = 0.5 * numbers(of, "length", "", 1)
        kind = "ellipsoid" if kind == "sphere" else kind
        return primitive_shape(kind, size, motion(element))

    def read(link: Element, elements: list[Element], name: str) -> Body:
        shapes, inertial = gather_shapes(map(shape, elements)), None
        if (frame := link.find("inertial")) is not None:
            of = attributes(frame, "inertia")
            keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            tensor = np.concatenate([numbers(of, key, "0", 1) for key in keys])
            (mass,) = numbers(attributes(frame, "mass"), "value", "0", 1)
            inertial = inertial_frame(mass, motion(frame), tensor)
        return make_link(name, shapes, [(each, each.volume) for each in shapes], inertial)

    for link in root.iterfind("link"):
        if elements := link.findall("collision") or link.findall("visual"):
            name, has_mass = link.get("name", ""), link.find("inertial") is not None
            yield NamedBody(name, partial(read, link, elements, name), "m", has_mass)
