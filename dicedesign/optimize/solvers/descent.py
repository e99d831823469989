"""Gradient descent on the dice energy (section 3.3), with the hull recomputed at every trial."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.reuse import HullMemory
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.shape import Coordinates
from dicedesign.optimize.coordinates.vertices import VertexCoordinates
from dicedesign.optimize.energy.objective import Evaluation, Objective
from dicedesign.optimize.energy.schedule import Schedule
from dicedesign.optimize.options import DescentOptions
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.optimize.solvers.line_search import LineSearch, has_slope
from dicedesign.optimize.solvers.sobolev import SobolevGradient
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.equilibria import classify
from dicedesign.results.status import Status
from dicedesign.runtime.arrays import Floats

__all__ = ["descend_to_target"]

NEAR_BOUNDARY: Final = 0.1
"""A given center of mass nearer to a facet than this part of the centroid's distance is a poor
origin for half-spaces: their distances are varied by factors."""


def descend_to_target(
    start: Start,
    target: Floats,
    options: DescentOptions,
    *,
    center_of_mass: Floats | None = None,
    seed: int = 0,
    on_step: Callable[[DesignStep], None] | None = None,
    on_evaluation: Callable[[Evaluation], None] | None = None,
) -> DesignResult:
    """Move a starting shape until its rests have the target probabilities.

    Parameters
    ----------
    start: shape and outcome directions.
    target: (k,) wanted probability of each direction of the start.
    options: see `DescentOptions`.
    center_of_mass: (3,) fixed, in the coordinates of `start.points`, or None for the uniform solid.
    seed: of the perturbation.
    on_step: called after every accepted step.
    on_evaluation: called with what every accepted step was recorded from, to look at more of it.

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
    descent = _Descent(start, target, options, center_of_mass, seed, on_step, on_evaluation)
    return descent.run()


class _Descent:
    """The loop: direction, step, new hull, stop."""

    def __init__(
        self,
        start: Start,
        target: Floats,
        options: DescentOptions,
        center_of_mass: Floats | None,
        seed: int,
        on_step: Callable[[DesignStep], None] | None,
        on_evaluation: Callable[[Evaluation], None] | None,
    ) -> None:
        shapes = HullMemory()
        hull = shapes.hull(start.points)
        origin = hull.centroid
        if center_of_mass is not None:
            center_of_mass = classify(hull, center_of_mass).center_of_mass
            clearance = hull.heights(center_of_mass).min()
            if clearance > NEAR_BOUNDARY * hull.heights(origin).min():
                origin = center_of_mass
        coordinates: Coordinates
        if options.coordinates == "facets":
            coordinates, parameters = FacetCoordinates.of(start.points, origin, shapes.hull)
        else:
            coordinates, parameters = VertexCoordinates.of(start.points, origin, shapes.hull)
        self.options = options
        self.schedule = Schedule(options.weights, options.relaxation, options.stopping.tolerance)
        self.objective = Objective(coordinates, target, options.weights, center_of_mass, shapes)
        self.started = time.perf_counter()
        self.on_step = on_step
        self.on_evaluation = on_evaluation
        self.line_search = LineSearch()
        self.evaluations = 1
        self.history: list[DesignStep] = []
        self.current = self.objective.first(
            parameters, start.directions, options.perturbation, seed
        )
        self.sobolev = SobolevGradient(options.sobolev)

    def run(self) -> DesignResult:
        self._record()
        status = None
        while status is None:
            status = self._advance()
        full = replace(self.objective, weights=self.options.weights)
        return DesignResult(
            status,
            self.current.rests.hull,
            self.current.directions,
            self.current.error,
            self.current.under(full).values,
            tuple(self.history),
            self.evaluations + self.line_search.evaluations,
            self.objective.shapes.built + self.objective.polars.built,
            self.objective.shapes.reused + self.objective.polars.reused,
        )

    def _advance(self) -> Status | None:
        limit = self.options.stopping.limit(self.history[-1].step, self._seconds())
        if limit is not None:
            return Status.CONVERGED if self._reached() else limit
        ascent = self.sobolev.of(self.current.gradient, self.current.rests.hull)
        following = self.line_search.search(self.current, ascent)
        if following is not None:
            self._accept(following)
            if not self.schedule.at_rest:
                return None
        # At rest under the present weights: done, or let some of them give way.
        if self._reached():
            return Status.CONVERGED
        if following is not None and not self.schedule.exhausted:
            return None
        if not self.schedule.give_way():
            lost = not has_slope(self.current.gradient)
            return Status.NO_GRADIENT if lost else Status.NO_PROGRESS
        self.objective = replace(self.objective, weights=self.schedule.weights)
        self.current = self.current.under(self.objective)
        self.line_search.restart()
        return None

    def _accept(self, following: Evaluation) -> None:
        pruned = self.objective.coordinates.pruned(following.parameters, following.rests)
        if len(pruned) != len(following.parameters):
            self.evaluations += 1
            fewer = self.objective.attempt(pruned, following.directions)
            if fewer is not None:
                following = fewer
                self.line_search.restart()
        self.current = following.refreshed()
        self._record()

    def _reached(self) -> bool:
        return self.current.error <= self.options.stopping.tolerance

    def _seconds(self) -> float:
        return time.perf_counter() - self.started

    def _record(self) -> None:
        current = self.current
        self.schedule.record(current.value)
        step = DesignStep(
            len(self.history), self._seconds(), current.value, current.values, current.error
        )
        self.history.append(step)
        if self.on_evaluation is not None:
            self.on_evaluation(current)
        if self.on_step is not None:
            self.on_step(step)
