"""The paper's method: its energy over vertices, with fixed weights, the hull after every step, and
Sobolev-preconditioned gradients (section 3.3). It leads to a die whose probabilities are near the
target; in an exact finish the rests of each outcome become one half-space, and the exact method
goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from dicedesign.errors import InputError, NoStartError
from dicedesign.geometry.hulls.hull import HullMemory
from dicedesign.optimize.coordinates import FacetCoordinates, VertexCoordinates
from dicedesign.optimize.energy import Evaluation, Objective, cluster
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.optimize.solvers.candidate import (
    Candidate,
    CandidateMaker,
    DesignResult,
    DesignStep,
)
from dicedesign.optimize.solvers.descent import LineSearch, Momentum, SobolevGradient, has_slope
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.terms import EnergyWeights
from dicedesign.rest.equilibria import classify
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats

POLISH: Final = 300
"""Most steps of line search after the steps with momentum."""

STALL: Final = (60, 0.02)
"""A line search has come to rest where of so many of its steps the later half lowered the energy by
less than this part."""


def solve_paper(
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
    """Move the vertices of a starting shape until its clustered rests have the target's
    probabilities.

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
    started, shapes = time.perf_counter(), HullMemory()
    hull = shapes.hull(start.points)
    if center_of_mass is not None:
        center_of_mass = classify(hull, np.asarray(center_of_mass, np.float64)).center_of_mass
    coordinates, parameters = VertexCoordinates.of(start.points, hull.centroid)
    weights = options.weights.of_probabilities
    objective = Objective(coordinates, target, weights, center_of_mass, shapes)
    first = objective.first(parameters, start.directions, options.perturbation, seed)
    sobolev = SobolevGradient(options.sobolev, drift)
    result = _Descent(first, sobolev, started, on_step, on_evaluation).run(options)
    if options.finish == "none":
        return result
    return finish_exactly(
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
        first: Evaluation,
        sobolev: SobolevGradient,
        started: float,
        on_step: Callable[[DesignStep], None] | None,
        on_evaluation: Callable[[Evaluation], None] | None,
    ) -> None:
        self.sobolev, self.started = sobolev, started
        self.on_step, self.on_evaluation = on_step, on_evaluation
        self.history: list[DesignStep] = []
        self.evaluations = 1
        self._record(first)

    def run(self, options: PaperOptions) -> DesignResult:
        """The best of all steps, and the line search from there."""
        steps, polish = options.steps, options.step == "momentum"
        if polish:
            self._go_with_momentum(steps)
        status = self._go_by_line_search(min(steps, POLISH) if polish else steps)
        if polish and status is Status.STEP_LIMIT and steps >= POLISH:
            # More of them would be more of the same.
            status = Status.NO_PROGRESS
        current, shapes = self.current, self.current.objective.shapes
        if current.error <= options.effective_tolerance:
            status = Status.CONVERGED
        return DesignResult(
            status,
            current.rests.hull,
            current.directions,
            current.error,
            current.energy.terms,
            tuple(self.history),
            self.evaluations,
            shapes.built,
            shapes.reused,
        )

    def _go_with_momentum(self, steps: int) -> None:
        rule, best = Momentum(steps), self.current
        while rule.evaluations < steps:
            following = rule.search(self.current, self._ascent())
            if following is None:
                break
            self._record(following.refresh())
            if self.current.value < best.value:
                best = self.current
        self._end(rule, best)

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
            # Go there, without the points that are no vertices any more.
            objective = following.objective
            pruned = objective.coordinates.prune(following.parameters, following.rests)
            if len(pruned) != len(following.parameters):
                self.evaluations += 1
                fewer = objective.attempt(pruned, following.directions)
                if fewer is not None:
                    following = fewer
                    rule.restart()
            self._record(following.refresh())
            energies.append(self.current.value)
            if self.current.value <= best.value:
                best = self.current
            earlier, later = energies[-window : -window // 2], energies[-window // 2 :]
            if len(energies) >= window and min(earlier) - min(later) < part * min(earlier):
                status = Status.NO_PROGRESS
                break
        self._end(rule, best)
        return status

    def _ascent(self) -> Floats:
        return self.sobolev.of(self.current.gradient, self.current.rests.hull)

    def _end(self, rule: LineSearch | Momentum, best: Evaluation) -> None:
        self.evaluations += rule.evaluations
        if self.current is not best:
            self._record(best)

    def _record(self, current: Evaluation) -> None:
        """Go on from an evaluation, which is a step."""
        self.current, terms = current, current.energy.terms
        seconds = time.perf_counter() - self.started
        step = DesignStep(len(self.history), seconds, current.value, terms, current.error)
        self.history.append(step)
        if self.on_evaluation is not None:
            self.on_evaluation(current)
        if self.on_step is not None:
            self.on_step(step)


ABSORBED: Final = (0.0, 1.0, 3.0, 6.0, 10.0, 15.0)
"""Angles, in degrees, within which a facet near that of an outcome gives way to it: one after the
other is tried."""

SAME_FACET: Final = 2.0
"""Angle, in degrees, up to which the rests of an outcome are always one."""

SUNK: Final = 0.97
"""Height of a half-space over that of the shape, for an outcome that has lost its rest."""

REPAIRING: Final = EnergyWeights(
    coplanar=0.0, barycenter=0.0, neighbor=0.0, stability=0.1, stability_margin=0.03
)
"""Of the steps to a shape with one rest for each outcome and no other, where there are more."""

MOST_REPAIRS: Final = 150
"""How many of these steps."""

KEPT_ANGLE: Final = 0.35
"""Angle between two outcomes, in radians (20 degrees), below which the exact method tries to keep
them apart."""


def finish_exactly(
    result: DesignResult,
    target: Floats,
    options: PaperOptions,
    *,
    center_of_mass: Floats | None = None,
    on_step: Callable[[DesignStep], None] | None = None,
    on_candidate: Callable[[Candidate], None] | None = None,
) -> DesignResult:
    """Result with probabilities (k,) exact to `options.tolerance`, improved by `options.prefer`;
    the given result if that fails.

    The history goes on from that of the result.
    """
    maker = CandidateMaker(center_of_mass)
    history, before = list(result.history), result.history[-1]

    def record(step: DesignStep, count: int, seconds: float) -> None:
        history.append(replace(step, step=count, seconds=seconds))
        if on_step is not None:
            on_step(history[-1])

    def on_exact_step(step: DesignStep) -> None:
        record(step, before.step + 1 + step.step, before.seconds + step.seconds)

    end, evaluations, built, reused = None, 0, 0, 0
    try:
        end = solve_exact(
            _starts(result, target, maker),
            target,
            ExactOptions(tolerance=options.effective_tolerance, prefer=options.prefer),
            center_of_mass=center_of_mass,
            least_angle=KEPT_ANGLE,
            on_step=on_exact_step,
            on_candidate=on_candidate,
        )
        evaluations, built, reused = end.evaluations, end.hulls_built, end.hulls_reused
    except NoStartError:
        pass
    is_exact = end is not None and end.status is Status.CONVERGED
    if not is_exact and len(history) > len(result.history):
        record(before, history[-1].step + 1, history[-1].seconds)
    best = end if end is not None and is_exact else result
    return replace(
        best,
        history=tuple(history),
        evaluations=result.evaluations + maker.evaluations + evaluations,
        hulls_built=result.hulls_built + maker.polars.built + maker.shapes.built + built,
        hulls_reused=result.hulls_reused + maker.polars.reused + maker.shapes.reused + reused,
        starts=result.starts,
    )


def _starts(result: DesignResult, target: Floats, maker: CandidateMaker) -> Iterator[Start]:
    """Shapes near a result with one rest for each outcome and no other."""
    center = maker.center_of_mass
    poses = analyze(result.hull, result.hull.centroid if center is None else center)
    for angle in ABSORBED:
        coordinates, parameters, directions = flatten(poses, result.directions, angle)
        if np.isnan(parameters).any():
            continue
        candidate = maker.attempt(coordinates, parameters, directions)
        if candidate is None:
            objective = Objective(
                coordinates, target, REPAIRING, center, maker.shapes, maker.polars
            )
            candidate = _repair(objective, parameters, directions, maker)
        if candidate is not None:
            yield Start(candidate.rests.hull.vertices, candidate.directions)


def _repair(
    objective: Objective, parameters: Floats, directions: Floats, maker: CandidateMaker
) -> Candidate | None:
    """A die with one rest for each outcome and no other that lies downhill; None where steps lead
    to none."""
    rule, current = LineSearch(), objective.attempt(parameters, directions)
    for _ in range(MOST_REPAIRS):
        if current is None:
            break
        tried = rule.evaluations
        current = rule.search(current, current.gradient)
        maker.evaluations += rule.evaluations - tried
        if current is None:
            break
        current = current.refresh()
        if current.flaws == 0:
            candidate = maker.attempt(objective.coordinates, current.parameters, current.directions)
            if candidate is not None:
                return candidate
    return None


def flatten(
    poses: RestPoses, directions: Floats, angle: float
) -> tuple[FacetCoordinates, Floats, Floats]:
    """Half-spaces of a shape on which each outcome has one facet.

    Its normal is the mean of those of the outcome's rests near the most probable one, by their
    probabilities, and it lies as high as their corners do on average.

    Parameters
    ----------
    poses: rests of the shape. directions: (k, 3) unit directions of the outcomes.
    angle: in degrees, within which other facets give way to the nearest outcome's.

    Returns coordinates about the center of mass, their parameters, of which the first k half-spaces
    are the outcomes', and the normals (k, 3) of these.
    """
    hull, center = poses.hull, poses.center_of_mass
    of_rest = cluster(poses.normals, directions).of_rest
    replaced = np.zeros(len(hull.normals), dtype=bool)
    mains, normals, distances = directions.copy(), [], []
    # Rests come the most probable first.
    outcomes, firsts = np.unique(of_rest, return_index=True)
    mains[outcomes] = poses.normals[firsts]
    nearest = np.argmax(hull.normals @ mains.T, axis=1)
    for outcome, main in enumerate(mains):
        near = poses.normals @ main >= np.cos(np.radians(max(angle, SAME_FACET)))
        mine = np.flatnonzero(near & (of_rest == outcome))
        if len(mine) == 0:
            normals.append(main)
            distances.append(SUNK * float(((hull.vertices - center) @ main).max()))
            continue
        probabilities = poses.probabilities[mine]
        normal = probabilities @ poses.normals[mine]
        normal = normal / np.sqrt(normal @ normal)
        corners = [hull.polygon(int(facet)) - center for facet in poses.facets[mine]]
        weights = np.repeat(probabilities, [len(part) for part in corners])
        normals.append(normal)
        distances.append(float(weights @ (np.concatenate(corners) @ normal) / weights.sum()))
        replaced[poses.facets[mine]] = True
        replaced |= (hull.normals @ normal > np.cos(np.radians(angle))) & (nearest == outcome)
    units = np.concatenate([np.array(normals), hull.normals[~replaced]])
    lengths = np.concatenate([np.array(distances), hull.heights(center)[~replaced]])
    lengths = np.where(lengths > 0.0, lengths, np.nan)
    parameters = np.concatenate([units.ravel(), np.log(lengths)])
    return FacetCoordinates(center), parameters, units[: len(directions)]
