"""How far to go along a descent direction."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.objective import Evaluation

__all__ = ["LineSearch"]

Floats = NDArray[np.float64]

FIRST_STEP = 0.02
SMALLEST_STEP = 1e-9
LARGEST_STEP = 10.0
LARGEST_MOVE = 0.1
SUFFICIENT_DECREASE = 1e-4
MEMORY = 5


@dataclass
class LineSearch:
    """Backtracking from a Barzilai-Borwein guess, measured against the worst of the last steps.

    The guess knows the curvature along the last step; comparing with the worst of the last
    `MEMORY` energies rather than the last one lets it work in narrow valleys. A step is taken only
    if it makes a solid, loses no outcome, and moves no parameter by more than `LARGEST_MOVE`: far
    enough away lies another solution with another set of rests.

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

    def search(self, at: Evaluation, descent: Floats) -> Evaluation | None:
        """An acceptable evaluation at `at.parameters - step * descent`, or None.

        descent: direction uphill, a preconditioned gradient with positive slope.
        """
        gradient, parameters = at.gradient, at.parameters
        if not np.isfinite([gradient, descent]).all():
            return None
        slope = float(gradient @ descent)
        if slope <= 0.0:
            return None
        self._energies = [*self._energies[-(MEMORY - 1) :], at.value]
        bound = max(self._energies)
        step = self._guess(parameters, gradient, descent)
        step = min(step, LARGEST_MOVE / float(np.abs(descent).max()))
        while step > SMALLEST_STEP:
            self.evaluations += 1
            trial = at.objective.attempt(parameters - step * descent, at.directions)
            enough = bound - SUFFICIENT_DECREASE * step * slope
            if trial is not None and trial.value <= enough and trial.flaws <= at.flaws:
                self._last = (parameters, gradient, descent, step)
                self._steps += 1
                return trial
            step *= 0.5
        return None

    def _guess(self, parameters: Floats, gradient: Floats, descent: Floats) -> float:
        if self._last is None:
            return FIRST_STEP
        old_parameters, old_gradient, old_descent, old_step = self._last
        moved, bent = parameters - old_parameters, gradient - old_gradient
        curvature = abs(float(moved @ bent))
        # The long and the short guess in turn, both in the metric of the preconditioner.
        if self._steps % 2 == 0:
            numerator, denominator = old_step * abs(float(moved @ old_gradient)), curvature
        else:
            numerator, denominator = curvature, abs(float(bent @ (descent - old_descent)))
        if denominator == 0.0:
            return min(2.0 * old_step, LARGEST_STEP)
        return float(np.clip(numerator / denominator, 1e-8, LARGEST_STEP))
