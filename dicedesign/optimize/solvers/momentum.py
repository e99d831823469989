"""Steps with momentum, which go over jumps of the energy.

The energy jumps wherever a rest comes or goes, and a line search ends in front of the first jump
up. Steps of a length that depends on time alone go on, and the design keeps the best of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from dicedesign.optimize.energy.objective import Evaluation
from dicedesign.optimize.solvers.line_search import has_slope
from dicedesign.runtime.arrays import Floats

__all__ = ["Momentum"]

LENGTH: Final = 0.004
"""Length of the first steps: root mean square of the changes of parameters, for an even slope."""

MEMORY: Final = 0.9
"""Part of the mean direction that a step keeps."""

SCALE_MEMORY: Final = 0.99
"""The same of the mean square."""

LARGEST: Final = 5.0
"""Largest entry of a direction in units of the root mean square; longer ones are shortened."""

SHORTER: Final = 0.5
"""Factor on the length after a step that is refused."""

SHORTEST: Final = 0.02
"""The factors' smallest product."""

LONGER: Final = 1.1
"""Factor after one that is taken, as long as the product is below 1."""

MOST_REFUSED: Final = 12
"""Refused steps in a row after which there is no way on."""


@dataclass
class Momentum:
    """Along the mean of the last directions, in units of the root mean square of their entries.

    One number scales all entries: so a turned die is led to the turned result, and a preconditioner
    keeps its metric. Steps grow shorter by a cosine in time. A step is refused only where there is
    no solid, or an outcome would be left without a rest (or has one too many, where a term with a
    weight minds that); then the mean starts anew. Of other jumps
    the energy takes no notice.

    Kingma and Ba, "Adam", ICLR 2015, with a scalar second moment.

    Attributes
    ----------
    steps: how many are made in all.
    evaluations: dice that were tried so far.
    """

    steps: int
    evaluations: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._length = 1.0
        self._forget()

    def search(self, at: Evaluation, ascent: Floats) -> Evaluation | None:
        """The next evaluation, of higher energy or lower, or None where there is none.

        ascent: (n,) direction uphill, a preconditioned gradient.
        """
        if not has_slope(ascent):
            return None
        for _ in range(MOST_REFUSED):
            self._remember(ascent)
            parameters = at.parameters - self._step()
            self.evaluations += 1
            trial = at.objective.attempt(parameters, at.directions)
            if trial is not None and trial.flaws <= at.flaws:
                self._length = min(LONGER * self._length, 1.0)
                return trial
            self._length = max(SHORTER * self._length, SHORTEST)
            self._forget()
        return None

    def _forget(self) -> None:
        self._mean: Floats | None = None
        self._square, self._remembered = 0.0, 0

    def _remember(self, ascent: Floats) -> None:
        before = np.zeros_like(ascent) if self._mean is None else self._mean
        self._mean = MEMORY * before + (1.0 - MEMORY) * ascent
        mean_square = float((ascent * ascent).mean())
        self._square = SCALE_MEMORY * self._square + (1.0 - SCALE_MEMORY) * mean_square
        self._remembered += 1

    def _step(self) -> Floats:
        """Change of the parameters downhill, with its sign reversed."""
        assert self._mean is not None
        count = self._remembered
        mean = self._mean / (1.0 - MEMORY**count)
        scale = np.sqrt(self._square / (1.0 - SCALE_MEMORY**count))
        if scale == 0.0:
            return np.zeros_like(mean)
        direction = mean / scale
        direction /= max(1.0, float(np.abs(direction).max()) / LARGEST)
        part = min(self.evaluations / self.steps, 1.0)
        return 0.5 * (1.0 + np.cos(np.pi * part)) * LENGTH * self._length * direction
