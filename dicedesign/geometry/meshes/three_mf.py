"""3MF files as slicers write them: core and production extension, and the volumes that PrusaSlicer,
Bambu Studio and OrcaSlicer mark as no material.

The XML is read as a stream, so that limits count before memory is filled. Coordinates keep their
float64 digits.
"""

from __future__ import annotations

import io
import re
import zipfile
from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import unquote
from xml.parsers import expat

import numpy as np

from dicedesign.errors import DiceError, MeshFileError
from dicedesign.geometry.meshes.body import Body, is_rounded, make_body
from dicedesign.geometry.meshes.parsing import EXPORT_AGAIN, QUOTED
from dicedesign.geometry.meshes.scenes import MAX_PLACED
from dicedesign.geometry.meshes.xml_files import max_unpacked
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import read_file

MAX_UNPACKED = 1 << 31
"""Limit of the unpacked bytes of a file: 2 GiB; see also `max_unpacked`."""

MAX_LISTED = 20_000
"""Limit of the objects, components, build items and volumes that a file lists."""

MAX_DEPTH = 100
"""Limit of objects within objects, and of elements within elements."""

MAX_NAMES = 10
"""Build items named in a message."""

CHUNK_BYTES = 1 << 18

MILLIMETERS = {
    "micron": 1e-3,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "inch": 25.4,
    "foot": 304.8,
    "meter": 1000.0,
}
"""Length of each unit of the format."""

PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"

KNOWN_EXTENSIONS = re.compile(
    rf"{PRODUCTION}|.*/3dmanufacturing/(material/|slice/|(core/)?trianglesets/).*"
)
"""Namespaces of extensions that leave meshes as they are."""

SLICER_PARTS = re.compile(r"metadata/(\w+_model\.config|model_settings\.config)")
"""Names, in lower case, of the parts in which slicers list the volumes of objects."""

NO_MATERIAL = {
    "parametermodifier": "modifier",
    "modifierpart": "modifier",
    "negativevolume": "negative volume",
    "negativepart": "negative volume",
    "supportblocker": "support blocker",
    "supportenforcer": "support enforcer",
}
"""Words for the kinds of volumes that print nothing, in lower case without underscores."""

Key = tuple[str, str]
"""Part of the archive, and number of an object in it."""

Handlers = Mapping[str, Callable[[dict[str, str]], object]]
"""Functions of the attributes of an element, by the names of the element and its parents."""


@dataclass(frozen=True)
class Component:
    """Object at a place. transform: (4, 4), to be multiplied by row vectors on its left."""

    key: Key
    transform: Floats


@dataclass
class Object:
    """Mesh or components. kind: "model", "support" and so on."""

    kind: str
    name: str
    points: array[float] = field(default_factory=lambda: array("d"))
    corners: array[int] = field(default_factory=lambda: array("i"))
    components: list[Component] = field(default_factory=list)


@dataclass
class Volume:
    """Part of an object that a slicer lists: a component by its object's number, or triangles."""

    component: str | None
    triangles: slice
    kind: str

    @property
    def word(self) -> str:
        """Why it is no material, or nothing."""
        return NO_MATERIAL.get(self.kind.replace("_", "").lower(), "")


class Build:
    """Bodies that a 3MF file builds, each in millimeters at its place on the plate.

    path: the file. `items` are its build items of type model.

    Raises MeshFileError: the file is missing, damaged or too large, requires an unknown extension,
    or has objects that contain themselves.
    """

    @np.errstate(all="ignore")  # numbers that are not finite are refused with the body
    def __init__(self, path: Path) -> None:
        self.path = path
        self._objects: dict[Key, Object] = {}
        self._volumes: dict[str, list[Volume]] = defaultdict(list)
        self._models: set[str] = set()
        self._sizes: dict[Key, int] = {}
        self._left_out: Counter[str] = Counter()
        self._unit = ""
        self._listed = 0
        data = read_file(path, "a 3MF file", error=MeshFileError)
        self._limit = self._room = max_unpacked(len(data), MAX_UNPACKED)
        items: list[Component] = []
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as self._archive:
                names = self._archive.namelist()
                self._parts = {_part_name(name): name for name in names}
                self._read_model(self._find_root(), items)
                for part in filter(SLICER_PARTS.fullmatch, self._parts):
                    self._read_volumes(part)
                # This reads the other models.
                size = max((self._size(item.key, ()) for item in items), default=0)
        except DiceError:
            raise
        except Exception as error:  # zipfile, its decoders and expat raise errors of many kinds
            raise self._error("an archive of XML", f"{type(error).__name__}: {error}") from error
        held = sum(len(each.points) + len(each.corners) for each in self._objects.values()) // 3
        limit = max(MAX_PLACED, 2 * held)
        if size > limit:
            expected = f"at most {limit} vertices, triangles and components in a build item"
            raise self._error(expected, f"{size}"[:QUOTED])
        kinds = [self._objects[item.key].kind for item in items]
        self._left_out.update(f"{kind} object" for kind in kinds if kind != "model")
        self.items = [
            item
            for item, kind in zip(items, kinds, strict=True)
            if kind == "model" and any(True for _ in self._meshes(item, Counter()))
        ]

    @np.errstate(all="ignore")
    def body(self, item: int | None = None) -> Body:
        """Body of a build item, from 1; without a number, of the only one.

        Raises MeshFileError: there is no such item, or more than one and no number.
        DegenerateBodyError: as `make_body`.
        """
        count = len(self.items)
        if item is None and count > 1:
            names = [
                f"{number} {self._objects[each.key].name or f'object {each.key[1]}'!a}"
                for number, each in enumerate(self.items[:MAX_NAMES], start=1)
            ]
            raise MeshFileError(
                f"{self.path}: expected one body, got {count} build items: {', '.join(names)}"
                f"{', ...' if count > MAX_NAMES else ''}; choose one with --item N"
            )
        number = 1 if item is None else item
        if not 1 <= number <= count:
            raise MeshFileError(
                f"{self.path}: expected a build item from 1 to {count}, got "
                f"{number if count else 'none with triangles of type model'}; "
                f"{'correct --item' if count else EXPORT_AGAIN}"
            )
        left_out = self._left_out.copy()
        points, triangles, start, rounded = [], [], 0, False
        for own, faces, transform in self._meshes(self.items[number - 1], left_out):
            rounded = rounded or is_rounded(own)
            moved = own @ transform[:3, :3] + transform[3, :3]
            points.append(own if np.array_equal(transform, np.eye(4)) else moved)
            mirrored = np.linalg.det(transform[:3, :3]) < 0  # a mirror turns a surface inside out
            triangles.append(start + (faces[:, ::-1] if mirrored else faces))
            start += len(own)
        name = str(self.path) if count == 1 else f"{self.path}#{number}"
        body = make_body(np.concatenate(points), np.concatenate(triangles), name, rounded)
        notes = [f"joined {len(points)} parts of the file"] if len(points) > 1 else []
        for what, times in left_out.items():
            uncut = ", whose cut is not made" if what == "negative volume" else ""
            notes.append(f"left out {times} {what}{'s' if times > 1 else ''}{uncut}")
        if self._unit != "millimeter":
            notes.append(f"converted lengths from {self._unit} to millimeter")
        return replace(body, notes=(*notes, *body.notes))

    def _meshes(
        self, item: Component, left_out: Counter[str]
    ) -> Iterator[tuple[Floats, Integers, Floats]]:
        """Points (n, 3), triangles (t, 3) and transform of each mesh of an item that is material.

        left_out: counts the others.
        """
        volumes = self._volumes[item.key[1]]
        pending = [item]
        while pending:
            placed = pending.pop()
            each = self._objects[placed.key]
            if each.kind != "model":
                left_out[f"{each.kind} object"] += 1
                continue
            points = np.asarray(each.points).reshape(-1, 3)
            triangles = np.asarray(each.corners, dtype=np.int64).reshape(-1, 3)
            kept = np.ones(len(triangles), dtype=bool)
            for volume in volumes:
                if volume.word and kept[volume.triangles].any():
                    kept[volume.triangles] = False
                    left_out[volume.word] += 1
            if not kept.all():
                used, corners = np.unique(triangles[kept], return_inverse=True)
                points, triangles = points[used], corners.reshape(-1, 3)
            if len(triangles):
                yield points, triangles, placed.transform
            words_of = defaultdict[str | None, list[str]](list)
            for volume in volumes:
                words_of[volume.component].append(volume.word)
            inner = []
            # The same object may be there several times, and is then listed as often.
            times: Counter[str] = Counter()
            for component in each.components:
                number = component.key[1]
                words = words_of[number]
                word = words[min(times[number], len(words) - 1)] if words else ""
                times[number] += 1
                if word:
                    left_out[word] += 1
                else:
                    transform = component.transform @ placed.transform
                    inner.append(Component(component.key, transform))
            pending += reversed(inner)
            # Slicers list the volumes of build items alone.
            volumes = []

    def _size(self, key: Key, above: tuple[Key, ...]) -> int:
        """Vertices, triangles and components that an object places; reads the object's model."""
        part, number = key
        if key in above:
            expected = "objects that do not contain themselves"
            raise self._error(expected, f"object {number!a} in {part}")
        if len(above) > MAX_DEPTH:
            raise self._error(f"at most {MAX_DEPTH} objects within one another", "more")
        if key not in self._sizes:
            if part not in self._models:
                self._read_model(part, [])
            if key not in self._objects:
                raise self._error(f"an object {number!a} in {part}", "none")
            each, above = self._objects[key], (*above, key)
            count, corners = len(each.points) // 3, np.asarray(each.corners)
            if not ((corners >= 0) & (corners < count)).all():
                expected = f"triangles of vertices 0 to {count - 1} in object {number!a}"
                raise self._error(expected, f"{corners.min()} to {corners.max()}")
            inner = sum(1 + self._size(component.key, above) for component in each.components)
            self._sizes[key] = count + len(corners) // 3 + inner
        return self._sizes[key]

    def _find_root(self) -> str:
        """Part with the build."""
        targets: list[str] = []

        def relationship(given: dict[str, str]) -> None:
            if given.get("Type", "").endswith("/3dmodel"):
                targets.append(_part_name(given["Target"]))

        if "_rels/.rels" in self._parts:
            self._walk("_rels/.rels", {"/Relationships/Relationship": relationship})
        return targets[0] if targets else "3d/3dmodel.model"

    def _read_model(self, part: str, items: list[Component]) -> None:
        """Read the objects of a part, and append its build items."""
        self._models.add(part)
        current = Object("", "")

        def model(given: dict[str, str]) -> None:
            for prefix in given.get("requiredextensions", "").split():
                uri = self._namespaces.get(prefix, prefix)
                if not KNOWN_EXTENSIONS.fullmatch(uri):
                    expected = "required extensions that leave meshes as they are"
                    raise self._error(expected, uri)
            # Other parts have the unit of the first, as their objects are placed there.
            self._unit = self._unit or given.get("unit", "millimeter")
            if self._unit not in MILLIMETERS:
                raise self._error(f"a unit out of {', '.join(MILLIMETERS)}", self._unit)

        def begin(given: dict[str, str]) -> None:
            nonlocal current
            self._count()
            current = Object(given.get("type", "model"), given.get("name", ""))
            self._objects[part, given["id"]] = current

        def vertex(given: dict[str, str]) -> None:
            current.points.extend((float(given["x"]), float(given["y"]), float(given["z"])))

        def triangle(given: dict[str, str]) -> None:
            current.corners.extend((int(given["v1"]), int(given["v2"]), int(given["v3"])))

        def placed(given: dict[str, str]) -> Component:
            self._count()
            path = given.get(f"{PRODUCTION} path")
            key = part if path is None else _part_name(path), given["objectid"]
            transform = np.eye(4)
            if numbers := given.get("transform", "").split():
                transform[:, :3] = np.array(numbers, dtype=np.float64).reshape(4, 3)
            return Component(key, transform)

        def item(given: dict[str, str]) -> None:
            component = placed(given)
            component.transform[:, :3] *= MILLIMETERS[self._unit]
            items.append(component)

        self._walk(
            part,
            {
                "/model": model,
                "/model/resources/object": begin,
                "/model/resources/object/mesh/vertices/vertex": vertex,
                "/model/resources/object/mesh/triangles/triangle": triangle,
                "/model/resources/object/components/component": lambda given: (
                    current.components.append(placed(given))
                ),
                "/model/build/item": item,
            },
        )

    def _read_volumes(self, part: str) -> None:
        """Read a slicer's list of volumes."""
        volumes: list[Volume] = []

        def begin(given: dict[str, str]) -> None:
            nonlocal volumes
            volumes = self._volumes[given.get("id", "")]

        def volume(given: dict[str, str]) -> None:
            self._count()
            is_range = "firstid" in given
            ends = (int(given["firstid"]), int(given["lastid"]) + 1) if is_range else (0, 0)
            volumes.append(Volume(given.get("id"), slice(*ends), given.get("subtype", "")))

        def metadata(given: dict[str, str]) -> None:
            key, value = given.get("key"), given.get("value", "")
            if key == "volume_type":
                volumes[-1].kind = value
            elif key == "modifier" and value == "1":
                volumes[-1].kind = "modifier_part"

        self._walk(
            part,
            {
                "/config/object": begin,
                "/config/object/volume": volume,
                "/config/object/part": volume,
                "/config/object/volume/metadata": metadata,
            },
        )

    def _walk(self, part: str, handlers: Handlers) -> None:
        """Read a part of XML and call a handler for each element that has one.

        Elements are in the namespace of the first, and have no prefix then.
        """
        if part not in self._parts:
            raise self._error(f"a part {part}", "an archive without")
        parser = expat.ParserCreate(namespace_separator=" ")
        self._namespaces: dict[str, str] = {}
        names, prefix = [""], ""

        def start(tag: str, given: dict[str, str]) -> None:
            nonlocal prefix
            if len(names) == 1:
                prefix = tag[: tag.rfind(" ") + 1]
            elif len(names) > MAX_DEPTH:
                raise self._error(f"at most {MAX_DEPTH} elements within one another", "more")
            name = f"{names[-1]}/{tag.removeprefix(prefix)}"
            names.append(name)
            handler = handlers.get(name)
            if handler is not None:
                try:
                    handler(given)
                except DiceError:
                    raise
                except (KeyError, ValueError, OverflowError) as error:
                    fields = " ".join(f'{key}="{value}"' for key, value in given.items())
                    element = f"<{name.rpartition('/')[2]} {fields}"[:QUOTED]
                    raise self._error(f"elements of 3MF in {part}", f"{element!a}") from error

        def namespace(name: str | None, uri: str | None) -> None:
            if len(names) == 1:
                self._namespaces[name or ""] = uri or ""

        def doctype(*_: object) -> None:
            raise self._error(f"no document type in {part}", "one")

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda _: names.pop()
        parser.StartNamespaceDeclHandler = namespace
        # Entities could grow without end.
        parser.StartDoctypeDeclHandler = doctype
        with self._archive.open(self._parts[part]) as file:
            # Larger and larger chunks, as each reads the element again that the last one cut.
            size = CHUNK_BYTES
            while chunk := file.read(size):
                size += len(chunk) // 8
                self._room -= len(chunk)
                if self._room < 0:
                    raise self._error(f"at most {self._limit >> 20} MiB of unpacked parts", "more")
                parser.Parse(chunk)
        parser.Parse(b"", True)

    def _count(self) -> None:
        self._listed += 1
        if self._listed > MAX_LISTED:
            expected = f"at most {MAX_LISTED} objects, components, build items and volumes"
            raise self._error(expected, "more")

    def _error(self, expected: str, got: object) -> MeshFileError:
        return MeshFileError(f"{self.path}: expected {expected}, got {got}; {EXPORT_AGAIN}")


def _part_name(path: str) -> str:
    """Name of a part as a key: names are alike in any case, and begin with a slash or not."""
    return unquote(path).replace("\\", "/").lstrip("/").lower()
