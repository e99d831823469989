"""Options of printing; apart from the measuring, so that a recipe loads no solids."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final

from dicedesign.errors import InputError, is_finite_number
from dicedesign.fabricate.printers import MATERIALS, PRINTERS, Printer
from dicedesign.runtime.registry import STRICT
from dicedesign.tolerances import MOST_MM

BELOW: Final = {
    "dimensional_mm": MOST_MM,
    "shrinkage": 0.2,
    "density_gradient": 0.5,
    "bubble_mm3": MOST_MM**3,
}
"""What each error is below: those in millimetres are beyond the largest die."""


@dataclass(frozen=True)
class PrintErrors:
    """Standard deviations of what differs from print to print, each normal and on its own.

    Those of an ordinary desktop printer for filament, unless given: ±0.2 mm between two faces, as
    two standard deviations of the difference of two planes, and shrinkage of 0.2 % that slicers do
    not make up for. Resin keeps to about half of that distance. How much density drifts, and what
    bubbles there are, nobody promises: these are guesses on the large side.

    Raises InputError for a value out of its range.
    Source: Layer X, 3D printing tolerances and dimensional accuracy, 2026, with ±0.2 to ±0.3 mm for
    filament, ±0.1 mm for resin, and a further 0.1 to 0.2 % of shrinkage.
    """

    __pydantic_config__ = STRICT

    dimensional_mm: float = 0.07
    """Place of the plane of each facet, along its normal; at least 0, below 1000."""
    shrinkage: float = 0.002
    """Relative length along each axis of the printer; at least 0, below 0.2."""
    density_gradient: float = 0.01
    """Relative change of the density from the bottom of the print to its top; at least 0, below
    0.5."""
    bubble_mm3: float = 1.0
    """Volume of a bubble somewhere in the print; at least 0, below 1e9."""

    @classmethod
    def within(cls, dimensional_mm: float, shrinkage: float) -> PrintErrors:
        """Those of a printer whose dimensions are off by at most so much, either way: as two
        standard deviations of the difference of two planes."""
        return cls(dimensional_mm=dimensional_mm / math.sqrt(8.0), shrinkage=shrinkage)

    def __post_init__(self) -> None:
        for field in fields(self):
            value, bound = getattr(self, field.name), BELOW[field.name]
            if not is_finite_number(value) or not 0.0 <= value < bound:
                raise InputError(
                    f"errors.{field.name}: expected a number of at least 0 and below {bound:g}, "
                    f"got {value!r}; leave it out for {field.default}"
                )


LARGEST_NOZZLE: Final = 2.0
"""Diameter in mm."""

DENSEST: Final = 25.0
"""Density in g/cm3, beyond that of any metal."""

THINNEST: Final = 0.05
"""Walls in mm, thinner than any printer's."""


@dataclass(frozen=True)
class PrintOptions:
    """What the die is printed with, which its printability is judged by.

    Raises InputError for a value that is unknown or out of its range.
    """

    __pydantic_config__ = STRICT

    printer: str = "fdm"
    """"fdm" for filament, "sla" for resin, "sls" for powder; a word alone, `print: sla`, is the
    printer."""
    nozzle_mm: float | None = None
    """Diameter of the nozzle, above 0 and at most `LARGEST_NOZZLE`; None for the usual 0.4."""
    material: str | None = None
    """Of which the die is: "pla", "petg", "abs", "asa" or "pc" for fdm, "resin" for sla, "pa12" for
    sls; None for the first of the printer's."""
    density_g_cm3: float | None = None
    """Density of the printed material, above 0 and at most `DENSEST`; None for the material's."""
    oriented: bool = False
    """Whether die_oriented.stl is written, which lies on the print bed as is best."""
    infill: float = 1.0
    """Part of the inside that is material, from 0, hollow, to 1, solid, which the odds are for."""
    walls_mm: float = 1.2
    """Thickness of the solid walls around the infill, floor and ceiling included, from
    `THINNEST` to `MOST_MM`."""
    errors: PrintErrors | None = None
    """How far prints are from what was asked for, see `PrintErrors`; None for the printer's."""

    def __post_init__(self) -> None:
        if self.printer not in PRINTERS:
            raise InputError(
                f"printer: expected {', '.join(PRINTERS.names)}, got {self.printer!r}; take one of "
                "them"
            )
        for name, most in (("nozzle_mm", LARGEST_NOZZLE), ("density_g_cm3", DENSEST)):
            value = getattr(self, name)
            if value is None:
                continue
            if not is_finite_number(value) or not 0 < value <= most:
                raise InputError(
                    f"{name}: expected a number above 0 and at most {most:g}, got {value!r}; "
                    "correct it"
                )
        if not is_finite_number(self.infill) or not 0.0 <= self.infill <= 1.0:
            raise InputError(
                f"infill: expected a number from 0 to 1, got {self.infill!r}; 0.2 is 20 %"
            )
        if not is_finite_number(self.walls_mm) or not THINNEST <= self.walls_mm <= MOST_MM:
            raise InputError(
                f"walls_mm: expected a number from {THINNEST:g} to {MOST_MM:g}, got "
                f"{self.walls_mm!r}; two lines of a 0.4 mm nozzle are 0.8"
            )
        if self.nozzle_mm is not None:
            PRINTERS[self.printer].with_nozzle(self.nozzle_mm)
        fitting = PRINTERS[self.printer].materials
        if self.material is not None and self.material not in fitting:
            raise InputError(
                f"material: expected {', '.join(fitting)} for {self.printer}, got "
                f"{self.material!r}; take one of them, or leave it out and give density_g_cm3"
            )

    @property
    def chosen(self) -> Printer:
        """The printer, with its nozzle."""
        printer = PRINTERS[self.printer]
        return printer if self.nozzle_mm is None else printer.with_nozzle(self.nozzle_mm)

    @property
    def expected_errors(self) -> PrintErrors:
        """Those that were given, or the printer's."""
        printer = PRINTERS[self.printer]
        if self.errors is not None:
            return self.errors
        return PrintErrors.within(printer.dimensional_error_mm, printer.shrinkage)

    @property
    def substance(self) -> str:
        """Name of the material."""
        return self.material or PRINTERS[self.printer].materials[0]

    @property
    def density(self) -> float:
        """Of the printed material, in g/cm3."""
        return self.density_g_cm3 or MATERIALS[self.substance].density_g_cm3
