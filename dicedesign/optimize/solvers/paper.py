"""The paper's method: its energy over vertices, with fixed weights, the hull after every step, and
Sobolev-preconditioned gradients (section 3.3)."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import HullMemory
from dicedesign.optimize.coordinates.facets import VertexCoordinates
from dicedesign.optimize.energy.energy import Evaluation, Objective
from dicedesign.optimize.options import PaperOptions
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.optimize.solvers.candidate import Candidate
from dicedesign.optimize.solvers.descent import LineSearch, Momentum, has_slope
from dicedesign.optimize.solvers.finish import finished
from dicedesign.optimize.solvers.sobolev import SobolevGradient
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.equilibria import classify
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats

POLISH: Final = 300
"""Most steps of line search after the steps with momentum."""

STALL: Final = (60, 0.02)
"""A line search has come to rest where of so many of its steps the later half lowered the energy by
less than this part."""


def descend_as_paper(
    start: Start,
    target: Floats,
    options: PaperOptions,
    *,
    center_of_mass: Floats | None = None,
    drift: bool = True,
    seed: int = 0,
    on_step: Callable[[DesignStep], None] | None = None,
    on_evaluation: Callable[[Evaluation], None] | None = None,
    on_candidate: Callable[[Candidate], None] | None = None,
) -> DesignResult:
    """Move the vertices of a starting shape until its clustered rests have the target's odds.

    Parameters
    ----------
    start: shape and outcome directions.
    target: (k,) wanted probability of each direction of the start.
    options: see `PaperOptions`.
    center_of_mass: (3,) fixed, in the coordinates of `start.points`, or None for the uniform solid.
    drift: whether steps may move the mean of the vertices.
    seed: of the perturbation.
    on_step: called after every step.
    on_evaluation: called with what every step before the finish was recorded from.
    on_candidate: called with the die that every step of the finish was recorded from.

    Raises
    ------
    InputError: the target does not have one probability for each direction, or the center of mass
        is not three finite numbers.
    DegenerateBodyError, OutsideHullError: the start is no solid with the center inside.
    """
    if len(target) != len(start.directions):
        raise InputError(
            f"target: expected {len(start.directions)} outcomes, one for each direction of the "
            f"start, got {len(target)}; take another start"
        )
    sobolev = SobolevGradient(options.sobolev, drift)
    if center_of_mass is not None:
        center_of_mass = np.asarray(center_of_mass, dtype=np.float64)
    result = _Descent(
        start, target, options, center_of_mass, sobolev, seed, on_step, on_evaluation
    ).run()
    if options.finish == "none":
        return result
    return finished(
        result,
        target,
        options,
        center_of_mass=center_of_mass,
        on_step=on_step,
        on_candidate=on_candidate,
    )


class _Descent:
    """The loop: direction, step, new hull, directions of the outcomes."""

    def __init__(
        self,
        start: Start,
        target: Floats,
        options: PaperOptions,
        center_of_mass: Floats | None,
        sobolev: SobolevGradient,
        seed: int,
        on_step: Callable[[DesignStep], None] | None,
        on_evaluation: Callable[[Evaluation], None] | None,
    ) -> None:
        self.started = time.perf_counter()
        self.options, self.on_step, self.on_evaluation = options, on_step, on_evaluation
        shapes = HullMemory()
        hull = shapes.hull(start.points)
        if center_of_mass is not None:
            center_of_mass = classify(hull, center_of_mass).center_of_mass
        coordinates, parameters = VertexCoordinates.of(start.points, hull.centroid, shapes.hull)
        weights = options.weights.of_probabilities
        self.objective = Objective(coordinates, target, weights, center_of_mass, shapes)
        self.sobolev = sobolev
        self.history: list[DesignStep] = []
        self.evaluations = 1
        self.current = self.objective.first(
            parameters, start.directions, options.perturbation, seed
        )

    def run(self) -> DesignResult:
        """The best of all steps, and the line search from there."""
        self._record()
        steps, polish = self.options.steps, self.options.step == "momentum"
        if polish:
            self._go_with_momentum(steps)
        status = self._go_by_line_search(min(steps, POLISH) if polish else steps)
        if polish and status is Status.STEP_LIMIT and steps >= POLISH:
            # More of them would be more of the same.
            status = Status.NO_PROGRESS
        if self.current.error <= self.options.reached:
            status = Status.CONVERGED
        return DesignResult(
            status,
            self.current.rests.hull,
            self.current.directions,
            self.current.error,
            self.current.values,
            tuple(self.history),
            self.evaluations,
            self.objective.shapes.built,
            self.objective.shapes.reused,
        )

    def _go_with_momentum(self, steps: int) -> None:
        rule, best = Momentum(steps), self.current
        while rule.evaluations < steps:
            following = rule.search(self.current, self._ascent())
            if following is None:
                break
            self.current = following.refreshed()
            self._record()
            if self.current.value < best.value:
                best = self.current
        self.evaluations += rule.evaluations
        self._go_back(best)

    def _go_by_line_search(self, steps: int) -> Status:
        rule, best, energies = LineSearch(), self.current, [self.current.value]
        status = Status.STEP_LIMIT
        window, part = STALL
        for _ in range(steps):
            following = rule.search(self.current, self._ascent())
            if following is None:
                lost = not has_slope(self.current.gradient)
                status = Status.NO_GRADIENT if lost else Status.NO_PROGRESS
                break
            self._accept(following, rule)
            energies.append(self.current.value)
            if self.current.value <= best.value:
                best = self.current
            earlier, later = energies[-window : -window // 2], energies[-window // 2 :]
            if len(energies) >= window and min(earlier) - min(later) < part * min(earlier):
                status = Status.NO_PROGRESS
                break
        self.evaluations += rule.evaluations
        self._go_back(best)
        return status

    def _go_back(self, best: Evaluation) -> None:
        if self.current is not best:
            self.current = best
            self._record()

    def _ascent(self) -> Floats:
        return self.sobolev.of(self.current.gradient, self.current.rests.hull)

    def _accept(self, following: Evaluation, rule: LineSearch) -> None:
        """Go there, without the points that are no vertices any more."""
        pruned = self.objective.coordinates.pruned(following.parameters, following.rests)
        if len(pruned) != len(following.parameters):
            self.evaluations += 1
            fewer = self.objective.attempt(pruned, following.directions)
            if fewer is not None:
                following = fewer
                rule.restart()
        self.current = following.refreshed()
        self._record()

    def _record(self) -> None:
        current, seconds = self.current, time.perf_counter() - self.started
        step = DesignStep(len(self.history), seconds, current.value, current.values, current.error)
        self.history.append(step)
        if self.on_evaluation is not None:
            self.on_evaluation(current)
        if self.on_step is not None:
            self.on_step(step)
