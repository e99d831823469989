"""A way to put a center of mass where it is wanted: what it is given, and what it makes.

Lengths are in millimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.stl import parsed_stl, stl_bytes
from dicedesign.geometry.sizes import MOST_MM
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checks import is_finite_number

__all__ = ["Made", "Material", "Way", "read_back", "stl_file"]

LEAST_WALL: Final = 0.05
"""Thinner than any printer's, in mm."""

DENSEST: Final = 25.0
"""Density in g/cm3, beyond that of any metal."""

MOST_WEIGHTS: Final = 20
"""Diameters to choose from."""


@dataclass(frozen=True)
class Material:
    """What a body is made of.

    Attributes
    ----------
    wall_mm: least thickness of solid walls, from `LEAST_WALL` to half of `MOST_MM`.
    drain_mm: diameter of a hole from each cavity to the outside, or None for closed ones.
    infill: the two densities of the inside over that of the walls, from 0 to 1, the lesser first.
    weights_mm: diameters of balls to choose from.
    weight_density: of these in g/cm3: steel. density: of what is printed: PLA.

    Raises InputError for a value out of its range.
    """

    wall_mm: float = 1.2
    drain_mm: float | None = None
    infill: tuple[float, float] = (0.1, 0.6)
    weights_mm: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0)
    weight_density: float = 7.8
    density: float = 1.24

    def __post_init__(self) -> None:
        most = 0.5 * MOST_MM
        _check("wall_mm", self.wall_mm, LEAST_WALL, most, "1.2 is three lines of a 0.4 mm nozzle")
        if self.drain_mm is not None:
            _check("drain_mm", self.drain_mm, LEAST_WALL, most, "3 lets resin and powder out")
        if len(self.infill) != 2 or not all(map(is_finite_number, self.infill)):
            raise InputError(f"infill: expected two parts, got {self.infill}; 0.1,0.6, say")
        if not 0.0 <= self.infill[0] < self.infill[1] <= 1.0:
            raise InputError(
                "infill: expected two parts from 0 to 1, the lesser first, got "
                f"{self.infill[0]:g},{self.infill[1]:g}; 0.1,0.6 is 10 % and 60 %"
            )
        if not 1 <= len(self.weights_mm) <= MOST_WEIGHTS:
            raise InputError(
                f"weights_mm: expected from 1 to {MOST_WEIGHTS} diameters, got "
                f"{len(self.weights_mm)}; name those that you have"
            )
        for diameter in self.weights_mm:
            _check("weights_mm", diameter, 0.5, most, "name diameters that you have")
        _check("density", self.density, 0.01, DENSEST, "PLA has 1.24 g/cm3")
        _check("weight_density", self.weight_density, 0.01, DENSEST, "steel has 7.8 g/cm3")
        if self.weight_density <= self.density:
            raise InputError(
                f"weight_density: expected more than the {self.density:g} g/cm3 of what is "
                f"printed, got {self.weight_density:g}; steel has 7.8"
            )


def _check(name: str, value: float, least: float, most: float, remedy: str) -> None:
    if not is_finite_number(value) or not least <= value <= most:
        raise InputError(
            f"{name}: expected a number from {least:g} to {most:g}, got {value!r}; {remedy}"
        )


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
