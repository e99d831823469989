"""Options of printing; apart from the measuring, so that a recipe loads no solids."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dicedesign.errors import InputError
from dicedesign.fabricate.printing.materials import MATERIALS
from dicedesign.fabricate.printing.print_errors import PrintErrors
from dicedesign.fabricate.printing.printer import PRINTERS, Printer
from dicedesign.geometry.sizes import MOST_MM
from dicedesign.runtime.checks import is_finite_number
from dicedesign.runtime.registry import STRICT

__all__ = ["PrintOptions"]

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
    supports: bool = False
    """Whether die_supports.stl is written: pillars under what hangs over in die_oriented.stl, which
    is written too, for a slicer that makes none."""
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
