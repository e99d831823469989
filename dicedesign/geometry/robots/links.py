"""Links of robots: rigid bodies of shapes that are fixed to each other, and XML that says them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from dicedesign.errors import InputError, MeshFileError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import Body, MassProperties, make_body, solid_triangles
from dicedesign.geometry.meshes.parsing import QUOTED
from dicedesign.geometry.meshes.scenes import MAX_PLACED
from dicedesign.geometry.meshes.xml_files import xml_root
from dicedesign.geometry.triangles import Surface, join_inertia, join_surfaces
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import MAX_TEXT_BYTES, read_file

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Attributes = Mapping[str, str]
"""Attributes of an XML element."""

MAX_TAGS = 1 << 20
"""Limit of the tags of a robot's file, and of all that it includes: one million."""

MAX_ATTRIBUTES = 100
"""Limit of the attributes of an element."""

MAX_SHAPES = 1000
"""Limit of the shapes of a link."""

SIDES = 32
"""Sides of the polyhedron that stands for a round shape."""


@dataclass(frozen=True)
class NamedBody:
    """Body of a file.

    Attributes
    ----------
    name: of a link or of a build item; empty for the only body of a mesh file.
    read: reads the body. Raises InputError.
    unit: of lengths.
    has_mass: the mass of its `mass_properties` is in kg.
    """

    name: str
    read: Callable[[], Body]
    unit: Literal["mm", "m"] = "mm"
    has_mass: bool = False


@dataclass(frozen=True)
class Shape:
    """Solid in the frame of a link.

    Attributes
    ----------
    surface: its surface, perhaps oriented inward.
    volume: its volume; of a round shape, not that of its polyhedron.
    single_precision, notes: as of a `Body`.
    """

    surface: Surface
    volume: float
    single_precision: bool
    notes: tuple[str, ...]


def mesh_shape(body: Body, scale: Floats, motion: Floats) -> Shape:
    """Shape of a body, or of its convex hull if it bounds no solid.

    scale: (3,) factors of its coordinates; motion: (4, 4), afterwards.
    """
    points = (body.points * scale) @ motion[:3, :3].T + motion[:3, 3]
    closed, notes = solid_triangles(body), body.notes
    if closed is None:
        surface = convex_hull(points).surface
        notes += (f"{body.name} bounds no solid and was taken as its convex hull",)
    else:
        surface = Surface(points, closed[0])
    return Shape(surface, abs(surface.volume), body.single_precision, notes)


def primitive_shape(kind: str, size: Floats, motion: Floats) -> Shape:
    """Shape of a "box", "ellipsoid", "cylinder" or "capsule", the last two along z.

    size: (3,) half the sides of a box, radii of an ellipsoid, or twice the radius and half the
    length of the others, of a capsule without its ends; motion: (4, 4).
    Raises InputError: a size is not above 0.
    """
    if not (size > 0.0).all():
        raise InputError(f"{kind}: expected sizes above 0, got {size.tolist()}; correct them")
    latitudes = np.linspace(-0.5, 0.5, SIDES // 2 + 1)[1:-1] * math.pi
    radii, heights = np.cos(latitudes), np.sin(latitudes)
    unit_volume = 4.0 / 3.0 * math.pi
    notes: tuple[str, ...] = (f"round shapes became polyhedra of {SIDES} sides",)
    if kind == "cylinder":
        radii, heights, unit_volume = np.ones(2), np.array([-1.0, 1.0]), 2.0 * math.pi
    angles = np.arange(SIDES) * (2.0 * math.pi / SIDES)
    x, y = radii[:, None] * np.cos(angles), radii[:, None] * np.sin(angles)
    rings = np.stack([x, y, np.repeat(heights, SIDES).reshape(x.shape)], axis=-1)
    points = np.concatenate([rings.reshape(-1, 3), [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]])
    if kind == "box":
        points, unit_volume, notes = np.array([*product((-1.0, 1.0), repeat=3)]), 8.0, ()
    if kind == "capsule":
        radius, _, half = size
        ends = [
            points[side * points[:, 2] >= 0.0] + (0, 0, side * half / radius) for side in (1, -1)
        ]
        points, size = np.concatenate(ends), np.full(3, radius)
        unit_volume += 2.0 * math.pi * half / radius
    surface = convex_hull(points * size @ motion[:3, :3].T + motion[:3, 3]).surface
    return Shape(surface, unit_volume * float(size.prod()), False, notes)


@dataclass(frozen=True)
class Inertial:
    """Inertial frame of a link.

    Attributes
    ----------
    mass: in kg; center_of_mass: (3,).
    inertia: (3, 3) about it, not divided by the mass; zero if unknown.
    """

    mass: float
    center_of_mass: Floats
    inertia: Floats


def make_link(
    name: str,
    shapes: Sequence[Shape],
    solids: Sequence[tuple[Shape, float]],
    inertial: Inertial | None,
) -> Body:
    """Body of shapes.

    Parameters
    ----------
    name: what to call it.
    shapes: shapes that touch the ground.
    solids: shapes with the masses that make up that of the body without an inertial frame. Where
        they overlap, both count.
    inertial: its inertial frame.

    Raises
    ------
    InputError: the mass is not above 0.
    DegenerateBodyError: as `make_body`.
    """
    masses = np.array([mass for _, mass in solids])
    mass = float(masses.sum()) if inertial is None else inertial.mass
    if not 0.0 < mass < math.inf:
        raise InputError(f"{name}: expected a mass above 0, got {mass:g}; correct it")
    if inertial is None or not inertial.inertia.any():
        if not masses.any():
            solids, masses = (
                [(shape, 0.0) for shape in shapes],
                np.array([s.volume for s in shapes]),
            )
        surfaces = [shape.surface for shape, _ in solids]
        centers = np.array([surface.centroid for surface in surfaces])
        inertias = np.array([surface.inertia for surface in surfaces])
        center, tensor = join_inertia(masses, centers, inertias)
        source = "solids of the link"
    if inertial is not None:
        center, source = inertial.center_of_mass, "inertial frame of the link"
        if inertial.inertia.any():
            tensor = inertial.inertia / mass
    surface = join_surfaces(*(shape.surface for shape in shapes))
    body = make_body(
        surface.points, surface.triangles, name, any(shape.single_precision for shape in shapes)
    )
    notes = dict.fromkeys(note for shape in shapes for note in shape.notes)
    volume = sum(shape.volume for shape in shapes)
    properties = MassProperties(mass, center, tensor, source, volume)
    return replace(body, notes=(*notes, *body.notes), mass_properties=properties)


def parse_xml(path: Path) -> Element:
    """Root element of a robot's file. Raises MeshFileError as `xml_root`, or if it is missing or
    has too many attributes."""
    data = read_file(path, "a robot", most=MAX_TEXT_BYTES, error=MeshFileError)
    try:
        root = xml_root(data, MAX_TAGS)
    except (SyntaxError, ValueError, LookupError) as error:
        raise MeshFileError(
            f"{path}: expected XML without document type and entities, but "
            f"{str(error)[: 3 * QUOTED]}; correct it"
        ) from error
    if (most := max(len(element.attrib) for element in root.iter())) > MAX_ATTRIBUTES:
        raise MeshFileError(
            f"{path}: expected at most {MAX_ATTRIBUTES} attributes of an element, got {most}; "
            "remove some"
        )
    return root


def gather_shapes(shapes: Iterable[Shape]) -> list[Shape]:
    """Shapes of a link. Raises InputError for too many, and for too many vertices and triangles."""
    gathered, size = list[Shape](), 0
    for shape in shapes:
        gathered.append(shape)
        size += len(shape.surface.points) + len(shape.surface.triangles)
        if len(gathered) > MAX_SHAPES or size > MAX_PLACED:
            raise InputError(
                f"expected at most {MAX_SHAPES} shapes of a link, with {MAX_PLACED} vertices and "
                "triangles, got more; simplify it"
            )
    return gathered


def numbers(of: Attributes, key: str, default: str, *counts: int) -> Floats:
    """Finite numbers of an attribute; counts: how many it may have (default: 3)."""
    text, counts = of.get(key, default), counts or (3,)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) not in counts or not np.isfinite(values).all():
        expected = " or ".join(map(str, counts))
        raise InputError(f"{key}: expected {expected} numbers, got {text[:40]!a}; correct them")
    return values


def inertial_frame(mass: float, motion: Floats, tensor: Floats) -> Inertial:
    """tensor: (6,) xx, yy, zz, xy, xz, yz in the frame that `motion` (4, 4) places."""
    xx, yy, zz, xy, xz, yz = tensor
    turn, inertia = motion[:3, :3], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Inertial(mass, motion[:3, 3], turn @ inertia @ turn.T)
