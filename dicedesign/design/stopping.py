"""When a design ends, and what is said then."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from dicedesign.errors import InputError
from dicedesign.options import STRICT

__all__ = ["Status", "Stopping"]


class Status(Enum):
    """Why a design stopped; the value is the message."""

    CONVERGED = "reached the tolerance"
    OFF_TARGET = (
        "reached the tolerance counting all rests near an outcome, but the die also rests "
        "elsewhere; raise weights.stability or weights.coplanar"
    )
    OFF_TABLE = (
        "reached the tolerance by the momentum model, but not in simulated throws; allow more with "
        "method.exact.refine.rounds or .drops"
    )
    NO_START = (
        "none of the starting shapes led there; try another seed, or allow more with "
        "method.exact.starts"
    )
    NO_PROGRESS = "no step lowers the energy any further; try another start, assignment or seed"
    NO_GRADIENT = (
        "the energy has no finite gradient at this shape, which balances exactly; raise "
        "method.descent.perturbation, or try another start or seed"
    )
    TOO_SMALL = (
        "reached the odds, but with a facet that has no room for a circle of min_inradius_mm; "
        "raise size_mm, lower min_inradius_mm, or try another seed"
    )
    STEP_LIMIT = "reached the number of steps; allow more steps"
    TIME_LIMIT = "ran out of time"


@dataclass(frozen=True)
class Stopping:
    """Limits of a design.

    Attributes
    ----------
    tolerance: largest |p - q| wanted, above 0 and below 1. The design ends where the energy first
        comes to rest within it, not at the first step that meets it.
    steps: largest number of accepted steps, at least 0.
    seconds: largest wall-clock time, positive.
    """

    __pydantic_config__ = STRICT

    tolerance: float = 1e-3
    steps: int = 3000
    seconds: float = 60.0

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(
                f"tolerance: expected a number in (0, 1), got {self.tolerance:g}; leave it out for "
                "1e-3"
            )
        if self.steps < 0:
            raise InputError(
                f"steps: expected a whole number not below 0, got {self.steps}; leave it out for "
                "3000"
            )
        if not 0.0 < self.seconds < np.inf:
            raise InputError(
                f"seconds: expected a positive number, got {self.seconds:g}; leave it out for 60"
            )

    def limit(self, step: int, seconds: float) -> Status | None:
        """The limit that has been reached, if any."""
        if step >= self.steps:
            return Status.STEP_LIMIT
        if seconds >= self.seconds:
            return Status.TIME_LIMIT
        return None
