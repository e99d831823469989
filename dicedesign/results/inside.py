"""What puts a die's center of mass where it was given, as result.json holds it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["Inside"]


@dataclass(frozen=True)
class Inside:
    """A cavity, infill or weights, measured in the files as they were read back.

    Attributes
    ----------
    by: "cavity", "infill" or "weights", as in a recipe's `inside`.
    shift_mm: distance from the center of mass of the uniform solid to that which was given; off_mm:
        from there to that of the files.
    wall_mm: least thickness of walls; None where nothing is inside.
    made: what was made, such as the places of weights; notes: the same for people, a sentence each.
    """

    by: str
    shift_mm: float
    off_mm: float
    wall_mm: float | None
    made: dict[str, Any]
    notes: tuple[str, ...]
