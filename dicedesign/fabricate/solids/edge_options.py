"""Options of edges; apart from the rounding, so that a recipe loads no hulls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from dicedesign.errors import InputError
from dicedesign.optimize.options import require_choice
from dicedesign.runtime.checks import is_finite_number
from dicedesign.runtime.registry import STRICT

__all__ = ["EdgeOptions", "core_scale"]

MOST_OF_SIZE: Final = 0.2
"""Largest radius, over the size of the die."""

LEAST_OF_SIZE: Final = 0.01
"""Smallest radius of a fillet, over the same: the strips of a finer one are of the size of what
files in single precision round."""

ROUNDING: Final = 1e-9
"""By how much a size that is measured may differ from the one that was asked for."""


@dataclass(frozen=True)
class EdgeOptions:
    """Edges and corners of a convex die.

    Raises InputError for a value out of its range.
    """

    __pydantic_config__ = STRICT

    radius_mm: float = 1.0
    """Radius of a fillet, or of the ball whose chords are the chamfers, above 0; at most a fifth of
    the die's size, and of the smallest facet's circle; that of a fillet at least a hundredth of the
    size."""
    shape: Literal["fillet", "chamfer"] = "fillet"
    """`fillet` rounds off, `chamfer` cuts flat."""

    def __post_init__(self) -> None:
        if not (is_finite_number(self.radius_mm) and self.radius_mm > 0.0):
            raise InputError(
                f"radius_mm: expected a finite number above 0, got {self.radius_mm!r}; enlarge it, "
                "or leave edges out"
            )
        require_choice("shape", self.shape, "fillet", "chamfer")


def core_scale(options: EdgeOptions | None, size_mm: float) -> float:
    """Size of the core of a die over that of the die.

    Raises InputError where the radius is too large or too small for the size.
    """
    if options is None:
        return 1.0
    part = options.radius_mm / size_mm
    if part > MOST_OF_SIZE * (1.0 + ROUNDING):
        raise InputError(
            f"edges.radius_mm: expected at most {MOST_OF_SIZE * size_mm:.3g}, a fifth of size_mm, "
            f"got {options.radius_mm:g}; lower it, or take a larger size_mm"
        )
    if options.shape == "fillet" and part < LEAST_OF_SIZE * (1.0 - ROUNDING):
        raise InputError(
            f"edges.radius_mm: expected at least {LEAST_OF_SIZE * size_mm:.3g} for a fillet, a "
            f"hundredth of size_mm, got {options.radius_mm:g}; enlarge it, take shape: chamfer, or "
            "leave edges out"
        )
    return 1.0 - 2.0 * part
