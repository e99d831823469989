"""When a design ends, and what is said then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.errors import InputError
from dicedesign.results.status import Status
from dicedesign.runtime.registry import STRICT

__all__ = ["Stopping"]


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
