"""Options of printing; apart from what they are for, so that a recipe loads no solids."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from dicedesign.errors import InputError
from dicedesign.fabricate.printing.print_errors import PrintErrors
from dicedesign.runtime.registry import STRICT

__all__ = ["PrintOptions"]


@dataclass(frozen=True)
class PrintOptions:
    """How the die will be printed.

    Raises InputError for a value out of its range.
    """

    __pydantic_config__ = STRICT

    infill: float = 1.0
    """Part of the inside that is material, from 0, hollow, to 1, solid, which the odds are for."""
    walls_mm: float = 1.2
    """Thickness of the solid walls around the infill, floor and ceiling included, above 0."""
    errors: PrintErrors = field(default_factory=PrintErrors)
    """How far prints are from what was asked for; see `PrintErrors`."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.infill <= 1.0:
            raise InputError(
                f"infill: expected a number from 0 to 1, got {self.infill:g}; 0.2 is 20 %"
            )
        if not 0.0 < self.walls_mm < math.inf:
            raise InputError(
                f"walls_mm: expected a number above 0, got {self.walls_mm:g}; two lines of a "
                "0.4 mm nozzle are 0.8"
            )
