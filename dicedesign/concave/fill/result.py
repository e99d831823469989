"""What a hull fill returns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dicedesign.runtime.arrays import Floats

__all__ = ["FillResult", "FillStatus", "FillStep"]


class FillStatus(Enum):
    """Why a fill stopped; the value is the message."""

    FITTED = "reached what was wanted"
    NO_PROGRESS = "no step comes any nearer; design the hull nearer to that of the surface"
    STEP_LIMIT = "reached the number of steps; allow more steps"
    UNSOLVED = (
        "a quadratic program was not solved; remesh the surface without slivers, or design the "
        "hull nearer to that of the surface"
    )


@dataclass(frozen=True)
class FillStep:
    """One accepted step.

    Attributes
    ----------
    step: number of the step, 0 for the start.
    seconds: since the start.
    terms: the energy's terms, weighted.
    gap: largest distance of a corner of the wanted hull from the surface, over the diagonal.
    outside: largest distance of a point of the surface outside the wanted hull, over the diagonal.
    """

    step: int
    seconds: float
    terms: dict[str, float]
    gap: float
    outside: float


@dataclass(frozen=True, eq=False)
class FillResult:
    """Where a fill ended.

    Attributes
    ----------
    points: (n, 3) of the surface, in the order of those it was made from.
    gap: largest distance of a corner of the wanted hull from the surface, over the diagonal.
    history: every accepted step, the first being the start.
    status: why it stopped.
    """

    points: Floats
    gap: float
    history: tuple[FillStep, ...]
    status: FillStatus

    @property
    def converged(self) -> bool:
        """Whether the hull, and the center of mass where one was asked for, are as wanted."""
        return self.status is FillStatus.FITTED

    @property
    def message(self) -> str:
        """The status in words."""
        return self.status.value
