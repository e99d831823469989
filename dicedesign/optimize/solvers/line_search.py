"""Step lengths along a descent direction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from dicedesign.optimize.energy.objective import Evaluation
from dicedesign.runtime.arrays import Floats

__all__ = ["LineSearch", "has_slope"]

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
