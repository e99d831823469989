"""How far prints are from what was asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Real

from dicedesign.errors import InputError
from dicedesign.runtime.registry import STRICT

__all__ = ["PrintErrors"]


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
    """Place of the plane of each facet, along its normal; at least 0."""
    shrinkage: float = 0.002
    """Relative length along each axis of the printer; at least 0, below 0.2."""
    density_gradient: float = 0.01
    """Relative change of the density from the bottom of the print to its top; at least 0, below
    0.5."""
    bubble_mm3: float = 1.0
    """Volume of a bubble somewhere in the print; at least 0."""

    @classmethod
    def within(cls, dimensional_mm: float, shrinkage: float) -> PrintErrors:
        """Those of a printer whose dimensions are off by at most so much, either way: as two
        standard deviations of the difference of two planes."""
        return cls(dimensional_mm=dimensional_mm / math.sqrt(8.0), shrinkage=shrinkage)

    def __post_init__(self) -> None:
        most = {"shrinkage": 0.2, "density_gradient": 0.5}
        for field in fields(self):
            value, least_too_large = getattr(self, field.name), most.get(field.name, math.inf)
            is_number = isinstance(value, Real) and not isinstance(value, bool)
            if not is_number or not 0.0 <= value < least_too_large:
                expected = "at least 0" + (
                    f" and below {least_too_large:g}" if field.name in most else ""
                )
                raise InputError(
                    f"errors.{field.name}: expected a number of {expected}, got {value!r}; "
                    f"leave it out for {field.default}"
                )
