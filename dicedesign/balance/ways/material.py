"""What a body is made of inside: options of the ways to move its center of mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from dicedesign.errors import InputError
from dicedesign.runtime.checks import is_finite_number
from dicedesign.runtime.registry import STRICT
from dicedesign.tolerances import MOST_MM

__all__ = ["InsideOptions", "Material"]

LEAST_WALL: Final = 0.05
"""Thinner than any printer's, in mm."""

DENSEST: Final = 25.0
"""Density in g/cm3, beyond that of any metal."""

MOST_WEIGHTS: Final = 20
"""Diameters to choose from."""


@dataclass(frozen=True)
class Material:
    """What a body is made of inside.

    Raises InputError for a value out of its range.
    """

    __pydantic_config__ = STRICT

    wall_mm: float = 1.2
    """Least thickness of solid walls, from `LEAST_WALL` to half of `MOST_MM`."""
    drain_mm: float | None = None
    """Diameter of a hole from each cavity to the outside; None for closed ones."""
    infill: tuple[float, float] = (0.1, 0.6)
    """The two densities of the inside over that of the walls, from 0 to 1, the lesser first."""
    weights_mm: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0)
    """Diameters of balls to choose from, at most `MOST_WEIGHTS`."""
    weight_density: float = 7.8
    """Of these in g/cm3; that of steel."""
    density: float = 1.24
    """Of what is printed, in g/cm3; that of PLA."""

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


@dataclass(frozen=True)
class InsideOptions(Material):
    """How the center of mass of a die gets to where it was given.

    Raises InputError for a value out of its range.
    """

    __pydantic_config__ = STRICT

    by: Literal["cavity", "infill", "weights"] = "cavity"
    """By a "cavity", by two densities of "infill", or by "weights"; a word alone, `inside: cavity`,
    is this."""
