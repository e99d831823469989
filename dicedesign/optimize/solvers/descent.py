"""Steps downhill: by a line search, or with momentum, which goes over jumps of the energy.

The energy jumps wherever a rest comes or goes, and a line search ends in front of the first jump
up. Steps of a length that depends on time alone go on, and the design keeps the best of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from dicedesign.optimize.energy.energy import Evaluation
from dicedesign.runtime.arrays import Floats

FIRST_STEP: Final = 0.02
"""Step length where nothing is known of the curvature."""

SMALLEST_GUESS: Final = 1e-8
"""Step length below which no search begins."""

SMALLEST_STEP: Final = 1e-9
"""Step length at which backtracking gives up, in units of a direction clipped to size 1."""

LARGEST_STEP: Final = 10.0
"""Step length above which no search begins."""

LARGEST_MOVE: Final = 0.1
"""Largest change of any parameter in one step."""

LARGEST_SLOPE: Final = 1e100
"""Largest entry of a gradient that counts as finite: its square must be."""

SUFFICIENT_DECREASE: Final = 1e-4
"""Part of the decrease that the slope promises, at most the whole energy, which a step must
achieve."""

MEMORY: Final = 5
"""Number of last energies of which the worst is the one to get below."""


def has_slope(*directions: Floats) -> bool:
    """True where gradients and what was made of them are numbers that can be worked with."""
    return all(bool((np.abs(vector) <= LARGEST_SLOPE).all()) for vector in directions)


@dataclass
class LineSearch:
    """Backtracking from a Barzilai-Borwein guess, measured against the worst of the last steps.

    The guess knows the curvature along the last step; comparing with the worst of the last
    `MEMORY` energies rather than the last one lets it work in narrow valleys. A step is taken only
    if it makes a solid, loses no outcome, and moves no parameter by more than `LARGEST_MOVE`: far
    enough away lies another solution with another set of rests.

    That limit also damps a gradient that is large without meaning much: where a path grazes the end
    of an arc it grows without bound, and then only its direction counts. Where
    it is no number, or beyond `LARGEST_SLOPE`, there is no step.

    Sources: Barzilai and Borwein, IMA J. Numer. Anal. 8, 1988; Grippo, Lampariello and Lucidi,
    SIAM J. Numer. Anal. 23, 1986.

    Attributes
    ----------
    evaluations: energies computed so far.
    """

    evaluations: int = 0
    _energies: list[float] = field(default_factory=list)
    _last: tuple[Floats, Floats, Floats, float] | None = None
    _steps: int = 0

    def restart(self) -> None:
        """Forget the past, after a change of objective or parameters."""
        self._energies.clear()
        self._last = None

    def search(self, at: Evaluation, ascent: Floats) -> Evaluation | None:
        """An acceptable evaluation at `at.parameters - step * ascent`, or None.

        ascent: direction uphill, a preconditioned gradient with positive slope.
        """
        gradient, parameters = at.gradient, at.parameters
        if not has_slope(gradient, ascent):
            return None
        slope = float(gradient @ ascent)
        if slope <= 0.0:
            return None
        self._energies = [*self._energies[-(MEMORY - 1) :], at.value]
        bound = max(self._energies)
        step = self._guess(parameters, gradient, ascent)
        size = float(np.abs(ascent).max())
        step = min(step, LARGEST_MOVE / size)
        while step * max(1.0, size) > SMALLEST_STEP:
            self.evaluations += 1
            trial = at.objective.attempt(parameters - step * ascent, at.directions)
            enough = bound - SUFFICIENT_DECREASE * min(step * slope, at.value)
            if trial is not None and trial.value <= enough and trial.flaws <= at.flaws:
                self._last = (parameters, gradient, ascent, step)
                self._steps += 1
                return trial
            step *= 0.5
        return None

    def _guess(self, parameters: Floats, gradient: Floats, ascent: Floats) -> float:
        if self._last is None:
            return FIRST_STEP
        old_parameters, old_gradient, old_ascent, old_step = self._last
        moved, bent = parameters - old_parameters, gradient - old_gradient
        curvature = abs(float(moved @ bent))
        # The long and the short guess in turn, both in the metric of the preconditioner.
        if self._steps % 2 == 0:
            numerator, denominator = old_step * abs(float(moved @ old_gradient)), curvature
        else:
            numerator, denominator = curvature, abs(float(bent @ (ascent - old_ascent)))
        if denominator == 0.0:
            return min(2.0 * old_step, LARGEST_STEP)
        return float(np.clip(numerator / denominator, SMALLEST_GUESS, LARGEST_STEP))


LENGTH: Final = 0.004
"""Length of the first steps: root mean square of the changes of parameters, for an even slope."""

DIRECTION_MEMORY: Final = 0.9
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
        self._mean = DIRECTION_MEMORY * before + (1.0 - DIRECTION_MEMORY) * ascent
        mean_square = float((ascent * ascent).mean())
        self._square = SCALE_MEMORY * self._square + (1.0 - SCALE_MEMORY) * mean_square
        self._remembered += 1

    def _step(self) -> Floats:
        """Change of the parameters downhill, with its sign reversed."""
        assert self._mean is not None
        count = self._remembered
        mean = self._mean / (1.0 - DIRECTION_MEMORY**count)
        scale = np.sqrt(self._square / (1.0 - SCALE_MEMORY**count))
        if scale == 0.0:
            return np.zeros_like(mean)
        direction = mean / scale
        direction /= max(1.0, float(np.abs(direction).max()) / LARGEST)
        part = min(self.evaluations / self.steps, 1.0)
        return 0.5 * (1.0 + np.cos(np.pi * part)) * LENGTH * self._length * direction
