"""The end of a hull fill: the surface, and the reason why it stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from dicedesign.runtime.arrays import Floats

__all__ = ["FillResult", "FillStatus", "OnEnergy"]

OnEnergy: TypeAlias = Callable[[float], None]
"""Called with the energy at the start and after every accepted step."""


class FillStatus(Enum):
    """Reasons why a fill stopped; the value is the message."""

    FITTED = "reached what was wanted"
    NO_PROGRESS = "no step comes any nearer; design the hull nearer to that of the surface"
    STEP_LIMIT = "reached the number of steps; allow more steps"
    UNSOLVED = (
        "a quadratic program was not solved; remesh the surface without slivers, or design the "
        "hull nearer to that of the surface"
    )


@dataclass(frozen=True, eq=False)
class FillResult:
    """The end of a fill.

    Attributes
    ----------
    points: (n, 3) of the surface, in the order of those it was made from.
    energy: there; those of different ways to fill do not compare.
    status: why it stopped.
    """

    points: Floats
    energy: float
    status: FillStatus

    @property
    def converged(self) -> bool:
        """True if the hull, and the center of mass where one was asked for, are as wanted."""
        return self.status is FillStatus.FITTED

    @property
    def message(self) -> str:
        """The status in words."""
        return self.status.value
