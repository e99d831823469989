"""A way to put a center of mass where it is wanted: what it is given, and what it makes.

Lengths are in millimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from dicedesign.balance.ways.material import Material
from dicedesign.concave.hollow.reach import reach
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.formats import parsed_stl, stl_bytes
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["Made", "Way", "reach_inside", "read_back", "stl_file"]


SAFE: Final = 0.95
"""Part of a reach that is relied on."""


@dataclass(frozen=True, eq=False)
class Made:
    """A body with its center of mass elsewhere, as files that were read back.

    Attributes
    ----------
    files: contents by what follows the name of the first, such as "_weights.json"; that of the body
        is "".
    body: as it was read back.
    center: (3,) of mass, of the files read back with their densities.
    wall_mm: least thickness of the walls, measured in them; None where nothing is inside.
    facts: plain data about what was made; notes: the same for people, a sentence each.
    sparse: the part of less infill, as it was read back, where there is one.
    """

    files: Mapping[str, bytes]
    body: Body
    center: Floats
    wall_mm: float | None
    facts: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    sparse: Body | None = None


@dataclass(frozen=True)
class Way:
    """A way.

    Attributes
    ----------
    name: by which it is asked for; line: what it does, in a line.
    reach: shifts of the center of mass from that of the uniform solid of a surface that it can do,
        nearly.
    make: the solid of a surface, whose coordinates are float32, with its center of mass at (3,).

    Both raise InputError where there is no room.
    """

    name: str
    line: str
    reach: Callable[[Surface, Material], ConvexHull]
    make: Callable[[Surface, Floats, Material], Made]


def stl_file(points: Floats, triangles: Integers) -> tuple[bytes, Body]:
    """A file, and the body that is read from it."""
    data = stl_bytes(points, triangles)
    return data, read_back(data)


def read_back(data: bytes) -> Body:
    """The body of an STL file."""
    points, triangles = parsed_stl(data, Path("body.stl"))
    return make_body(points, triangles, "body.stl", single_precision=True)


def reach_inside(
    surface: Surface, material: Material, densities: tuple[float, float] = (0.0, 1.0)
) -> ConvexHull:
    """Shifts of the center of mass by two densities within walls, see `reach`, to be safe a little
    less. Raises InputError where walls leave no room."""
    try:
        return reach(surface, material.wall_mm, SAFE, densities)
    except InputError as error:
        raise InputError(
            f"wall_mm: expected walls that leave room inside, got {material.wall_mm:g} mm in a "
            f"body of {' x '.join(f'{x:.3g}' for x in np.ptp(surface.points, axis=0))} mm; reduce "
            "wall_mm, or enlarge the body with size_mm"
        ) from error
