"""How far prints are from what was asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final

from dicedesign.errors import InputError
from dicedesign.geometry.sizes import MOST_MM
from dicedesign.runtime.checks import is_finite_number
from dicedesign.runtime.registry import STRICT

__all__ = ["PrintErrors"]

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
