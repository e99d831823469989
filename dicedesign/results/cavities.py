"""The cavities of a die, as result.json holds them."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Cavities"]


@dataclass(frozen=True)
class Cavities:
    """Cavities that bring the center of mass to where the odds are those of the target, measured in
    the file as it was read back.

    Attributes
    ----------
    number: of closed parts.
    wall_mm: least distance between the surface and that of a cavity.
    volume_mm3: of all; part: that over the volume of the die without them.
    shift_mm: distance that they move the center of mass.
    """

    number: int
    wall_mm: float
    volume_mm3: float
    part: float
    shift_mm: float
