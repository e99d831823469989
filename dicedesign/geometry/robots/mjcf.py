"""Bodies of MJCF files, as MuJoCo reads them: default classes, included files, frames, meshes and
other shapes, and inertia."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.robots.links import (
    MAX_TAGS,
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
from dicedesign.geometry.sphere import rigid_motion, rotation_between, unit_vectors
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MAX_INCLUDES = 100

USED_DEFAULTS = frozenset(("geom", "mesh"))
"""Elements whose default attributes are read."""

DEFAULT_DENSITY = 1000.0
"""Density of shapes in kg/m^3."""

Frame = tuple[Attributes, "Frame | None"]
"""Attributes of a frame, and the frame around it."""

Geom = tuple[Attributes, Frame | None]
"""Attributes of a shape, and the frame around it."""


class MjcfModel:
    """Model of an MJCF file.

    Attributes
    ----------
    compiler: settings of the file.
    classes: attributes by tag, by default class.
    assets: attributes of each mesh by its name.
    """

    def __init__(self, path: Path, root: Element, read_mesh: Callable[[Path], Body]) -> None:
        self.folder, self.root, self.read_mesh = path.parent, root, read_mesh
        self._include()
        self.compiler: dict[str, str] = {}
        for element in root.iterfind("compiler"):
            self.compiler |= element.attrib
        self.classes: dict[str, dict[str, Attributes]] = {"main": {}}
        pending = [(element, "main", "main") for element in root.iterfind("default")][::-1]
        while pending:
            element, name, above = pending.pop()
            # A class may be in several places, such as in included files.
            base = self.classes.get(name, self.classes[above])
            own = {
                child.tag: {**base.get(child.tag, {}), **child.attrib}
                for child in element
                if child.tag in USED_DEFAULTS
            }
            self.classes[name] = {**base, **own}
            inner = [(each, each.get("class", ""), name) for each in element.iterfind("default")]
            pending += inner[::-1]
        for element in root.iterfind("default"):
            self.classes.setdefault(element.get("class", "main"), self.classes["main"])
        meshes = [self.attributes(mesh, "main") for mesh in root.iterfind("asset/mesh")]
        self.assets = {of.get("name", Path(of.get("file", "")).stem): of for of in meshes}

    def _include(self) -> None:
        """Replace each `include` with the content of its file. Raises InputError: too many, or too
        large."""
        pending, includes, tags = [self.root], 0, 0
        while pending:
            parent, k = pending.pop(), 0
            while k < len(parent):
                if parent[k].tag != "include":
                    pending.append(parent[k])
                    k += 1
                    continue
                included = parse_xml(self.folder / parent[k].get("file", ""))
                parent[k : k + 1] = list(included)
                includes, tags = includes + 1, tags + sum(1 for _ in included.iter())
                if includes > MAX_INCLUDES or tags > MAX_TAGS:
                    raise InputError(
                        f"include: expected at most {MAX_INCLUDES} with {MAX_TAGS} tags, got more; "
                        "merge them"
                    )

    def attributes(self, element: Element, class_name: str) -> Attributes:
        """Attributes of an element with those of its default class."""
        class_name = element.get("class", class_name)
        if class_name not in self.classes:
            raise InputError(f"class: expected a default class, got {class_name!a}; define it")
        return {**self.classes[class_name].get(element.tag, {}), **element.attrib}

    def motion(self, of: Attributes) -> Floats:
        """Motion (4, 4) of a frame."""
        try:
            with np.errstate(divide="raise", invalid="raise"):
                turn = self._turn(of)
        except (InputError, FloatingPointError, ValueError) as error:
            raise InputError(
                f"orientation: expected a rotation, but {error}; correct it"
            ) from error
        return rigid_motion(turn, numbers(of, "pos", "0 0 0"))

    def _turn(self, of: Attributes) -> Floats:
        # Mesh files do without this.
        from scipy.spatial.transform import Rotation

        degrees = self.compiler.get("angle", "degree") == "degree"
        if "euler" in of:
            turn, order = np.eye(3), self.compiler.get("eulerseq", "xyz")
            for axis, angle in zip(order, numbers(of, "euler", ""), strict=True):
                one = Rotation.from_euler(axis.lower(), angle, degrees).as_matrix()
                turn = turn @ one if axis.islower() else one @ turn
            return turn
        if "axisangle" in of:
            *vector, angle = numbers(of, "axisangle", "", 4)
            return Rotation.from_rotvec(unit_vectors(np.array(vector)) * angle, degrees).as_matrix()
        if "xyaxes" in of:
            x, y = numbers(of, "xyaxes", "", 6).reshape(2, 3)
            z = np.cross(x, y)
            return unit_vectors(np.array([x, np.cross(z, x), z])).T
        if "zaxis" in of:
            return rotation_between(np.array([0.0, 0.0, 1.0]), numbers(of, "zaxis", ""))
        quaternion = numbers(of, "quat", "1 0 0 0", 4)
        return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()

    def links(self) -> list[NamedBody]:
        """Bodies with shapes, in the order of the file."""
        links: list[NamedBody] = []
        pending = [(world, "main") for world in self.root.iterfind("worldbody")][::-1]
        count = 0
        while pending:
            element, class_name = pending.pop()
            class_name = element.get("childclass", class_name)
            if element.tag == "body":
                count += 1
                geoms = self._geoms(element, class_name)
                if geoms:
                    name = element.get("name", f"body {count}")
                    read = partial(self._read, element, geoms, name)
                    links.append(NamedBody(name, read, "m", True))
            children = [child for child in element if child.tag in ("body", "frame")]
            pending += [(child, class_name) for child in reversed(children)]
        return links

    def _geoms(self, body: Element, class_name: str) -> list[Geom]:
        """Attributes of the shapes of a body, and the frame around each."""
        geoms: list[Geom] = []
        pending: list[tuple[Element, str, Frame | None]] = [(body, class_name, None)]
        while pending:
            element, class_name, frame = pending.pop()
            for child in element:
                if child.tag == "geom":
                    of = self.attributes(child, class_name)
                    if of.get("type") not in ("plane", "hfield"):
                        geoms.append((of, frame))
                elif child.tag == "frame":
                    inner = child.get("childclass", class_name)
                    pending.append((child, inner, (child.attrib, frame)))
                elif child.tag in ("replicate", "attach"):
                    raise InputError(
                        f"{child.tag}: expected bodies written out, got this element; save the "
                        "compiled model, for example with mj_saveLastXML"
                    )
        return geoms

    def _frame(self, known: dict[int, Floats], frame: Frame | None) -> Floats:
        """Motion (4, 4) of a frame in its body. known: those of frames by their identity."""
        unknown = list[Frame]()
        while frame is not None and id(frame) not in known:
            unknown.append(frame)
            frame = frame[1]
        motion = np.eye(4) if frame is None else known[id(frame)]
        for inner in reversed(unknown):
            motion = known[id(inner)] = motion @ self.motion(inner[0])
        return motion

    def _read(self, body: Element, geoms: list[Geom], name: str) -> Body:
        solids, colliding, inertial = [], [], None
        low, high = numbers(self.compiler, "inertiagrouprange", "0 5", 2)
        frame_of = partial(self._frame, {})
        shapes = gather_shapes(self._shape(of, frame_of(frame)) for of, frame in geoms)
        for shape, (of, _) in zip(shapes, geoms, strict=True):
            (density,) = numbers(of, "density", str(DEFAULT_DENSITY), 1)
            (mass,) = numbers(of, "mass", str(density * shape.volume), 1)
            counts = low <= numbers(of, "group", "0", 1)[0] <= high
            solids.append((shape, mass if counts else 0.0))
            if any(numbers(of, key, "1", 1)[0] for key in ("contype", "conaffinity")):
                colliding.append(shape)
        frame = body.find("inertial")
        if frame is not None and self.compiler.get("inertiafromgeom") != "true":
            (mass,) = numbers(frame.attrib, "mass", "", 1)
            diagonal = numbers(frame.attrib, "diaginertia", "0 0 0").tolist()
            default = " ".join(map(str, [*diagonal, 0, 0, 0]))
            tensor = numbers(frame.attrib, "fullinertia", default, 6)
            inertial = inertial_frame(mass, self.motion(frame.attrib), tensor)
        return make_link(name, colliding or [shape for shape, _ in solids], solids, inertial)

    def _shape(self, of: Attributes, frame: Floats) -> Shape:
        kind = of.get("type", "sphere")
        if kind in ("mesh", "sdf"):
            if (asset := self.assets.get(of.get("mesh", ""))) is None:
                raise InputError(f"mesh: expected an asset, got {of.get('mesh')!a}; add it")
            folder = self.compiler.get("meshdir", self.compiler.get("assetdir", ""))
            if "file" not in asset:
                raise InputError("mesh: expected a file, got points; save them as an OBJ file")
            body = self.read_mesh(self.folder / folder / asset["file"])
            # The attributes refpos and refquat.
            frame_of_file = self.motion({key[3:]: asset[key] for key in asset if key[:3] == "ref"})
            points = (body.points - frame_of_file[:3, 3]) @ frame_of_file[:3, :3]
            scale = numbers(asset, "scale", "1 1 1")
            return mesh_shape(replace(body, points=points), scale, frame @ self.motion(of))
        if kind not in ("box", "sphere", "ellipsoid", "cylinder", "capsule") or "mesh" in of:
            raise InputError(
                f"type: expected mesh or a shape without mesh, got {kind[:40]!a}; change it"
            )
        size, motion = np.zeros(3), self.motion(of)
        values = numbers(of, "size", "0", 1, 2, 3)
        size[: len(values)] = values
        if "fromto" in of:
            start, end = numbers(of, "fromto", "", 6).reshape(2, 3)
            turn = rotation_between(np.array([0.0, 0.0, 1.0]), start - end)
            motion = rigid_motion(turn, 0.5 * (start + end))
            size[1:] = size[0], 0.5 * np.linalg.norm(end - start)
        elif kind == "sphere":
            size[1:] = size[0]
        elif kind in ("cylinder", "capsule"):
            size[1:] = size[:2]
        kind = "ellipsoid" if kind == "sphere" else kind
        return primitive_shape(kind, size, frame @ motion)
