"""The paper's method: it minimizes the energy over vertices, with a new hull after every step and
Sobolev-preconditioned gradients (section 3.3).

The die then has probabilities near the target. An exact finish replaces the rests of each outcome
by one half-space and continues with the exact method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from dicedesign.errors import InputError, NoStartError
from dicedesign.geometry.sphere import angle_between
from dicedesign.optimize.clusters import cluster
from dicedesign.optimize.coordinates import FacetCoordinates, ShapeEvaluator, VertexCoordinates
from dicedesign.optimize.energy import Evaluation, Objective
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.optimize.solvers.candidate import (
    Candidate,
    CandidateMaker,
    DesignResult,
    DesignStep,
    StepLog,
)
from dicedesign.optimize.solvers.descent import LineSearch, Momentum, SobolevGradient, has_slope
from dicedesign.optimize.solvers.exact import ExactSearch
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.terms import EnergyWeights
from dicedesign.rest.equilibria import classify
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats, Integers

MAX_LINE_SEARCH_STEPS = 300
"""Limit on the steps of a line search after steps with momentum."""

STALL = (60, 0.02)
"""A line search stalls when, of this number of steps, the second half lowers the energy by less
than this part."""


def solve_paper(
    start: Start,
    target: Floats,
    options: PaperOptions,
    *,
    center_of_mass: Floats | None = None,
    drift: bool = True,
    seed: int = 0,
    outcome_of: Integers | None = None,
    on_step: Callable[[DesignStep], None] | None = None,
    on_evaluation: Callable[[Evaluation], None] | None = None,
    on_candidate: Callable[[Candidate], None] | None = None,
) -> DesignResult:
    """Move the vertices of a starting shape until its outcomes have the target probabilities.

    Parameters
    ----------
    start: shape and outcome directions.
    target: (k,) target probability of each outcome.
    options: see `PaperOptions`.
    center_of_mass: (3,) fixed, in the coordinates of `start.points`, or None for the uniform solid.
    drift: whether steps may move the mean of the vertices.
    seed: seed of the perturbation.
    outcome_of: (f,) outcome of each direction of the start, whose probabilities sum to its own in
        any shares; None for one outcome each, f = k.
    on_step: called after every step.
    on_evaluation: called before that with the evaluation of a step before the finish.
    on_candidate: called before that with the die of a step of the finish.

    Raises
    ------
    InputError: the target does not suit the directions, or the center of mass is not three finite
        numbers.
    DegenerateBodyError, OutsideHullError: the start is no solid with the center inside.
    """
    faces = len(target if outcome_of is None else outcome_of)
    if faces != len(start.directions):
        raise InputError(
            f"target: expected {len(start.directions)} outcomes, one for each direction of the "
            f"start, got {faces}; take another start"
        )
    log, evaluator = StepLog(on_step, on_evaluation), ShapeEvaluator(None)
    hull = evaluator.shapes.hull(start.points)
    if center_of_mass is not None:
        evaluator.center_of_mass = classify(hull, center_of_mass).center_of_mass
    coordinates, parameters = VertexCoordinates.of(start.points, hull.centroid)
    weights = options.weights.of_probabilities
    if options.step == "line_search":
        weights = weights.replace(hold=0.0, clear=0.0)
    objective = Objective(coordinates, target, weights, evaluator, outcome_of)
    first = objective.first(parameters, start.directions, options.perturbation, seed)
    descent = _Descent(first, SobolevGradient(options.sobolev, drift), log)
    result = descent.run(options, seed)
    if options.finish == "none":
        return result
    log.on_shape = on_candidate
    return finish_exactly(result, target, options, evaluator.center_of_mass, log, outcome_of)


FADES = {
    "barycenter": (0.4, 0.9, 0.0),
    "neighbor": (0.4, 0.9, 0.0),
    "hold": (0.4, 0.9, 0.2),
    "hold_margin": (0.4, 0.9, 0.1),
    "clear": (0.5, 1.0, 0.0),
}
"""For weights and options that fade: the parts of the steps with momentum at which they begin and
cease to fall, along half a cosine, and the factor that remains."""

FADE_STEPS = 5
"""Steps with momentum between two changes of the weights."""

GOOD_ERROR = 2e-3
"""Largest |p - q| of a shape that is not improved any further."""

GOOD_ANGLE = np.radians(12.0)
"""Least angle between two outcomes of such a shape."""

HOP_STEPS = 4 / 9
"""Steps with momentum of such a try, as a part of those of the first try."""

HOP_NOISE = 0.03
"""Standard deviation of the noise of the first hop; the half extent of the start is 1."""

HOP_GROWTH = 1.6
"""Factor on the noise from one hop to the next."""

FEW_VERTICES = 40
"""A hop from a shape with fewer vertices adds the middles of its edges: a tetrahedron, for one, has
too few numbers for most targets."""


def fade_weights(weights: EnergyWeights, part: float) -> EnergyWeights:
    """Weights after a part, 0 to 1, of the steps with momentum."""
    faded = {}
    for name, (first, last, end) in FADES.items():
        progress = min(max((part - first) / (last - first), 0.0), 1.0)
        faded[name] = getattr(weights, name) * float(
            end + (1.0 - end) * 0.5 * (1.0 + np.cos(np.pi * progress))
        )
    return weights.replace(**faded)


def _rank(evaluation: Evaluation) -> tuple[int, float]:
    """Number of faces without a rest, and the sum of the terms that do not fade: the lower, the
    better the shape."""
    terms = evaluation.energy.terms.items()
    return evaluation.clusters.empty, sum(value for name, value in terms if name not in FADES)


def assign_facets(evaluation: Evaluation) -> Evaluation:
    """Give the faces distinct facets, whose normals become their directions: those with the
    largest sum of cosines and depths, where rests have an advantage."""
    # Imported late, as few descents use it.
    from scipy.optimize import linear_sum_assignment

    rests, directions = evaluation.rests, evaluation.directions.copy()
    gain = directions @ rests.hull.normals.T + 0.5 * np.clip(rests.depths, -0.5, 0.5)
    gain[:, rests.facets] += 0.5
    outcomes, facets = linear_sum_assignment(-gain)
    directions[outcomes] = rests.hull.normals[facets]
    return replace(evaluation, directions=directions)


class _Descent:
    """Loop over steps: direction, step, new hull, new directions of the outcomes."""

    def __init__(self, first: Evaluation, sobolev: SobolevGradient, log: StepLog) -> None:
        self.sobolev, self.log, self.best = sobolev, log, first
        self.weights = first.objective.weights
        self._record(first)

    def run(self, options: PaperOptions, seed: int) -> DesignResult:
        """Take steps of the wanted kind."""
        if options.step == "line_search":
            status = self._go_by_line_search(options.steps)
        else:
            self._go_with_tries(options, seed)
            status = Status.NO_PROGRESS
        current, evaluator = self.current, self.current.objective.evaluator
        if current.error <= options.effective_tolerance:
            status = Status.CONVERGED
        return DesignResult(
            status,
            current.rests.hull,
            current.directions,
            current.error,
            current.energy.terms,
            tuple(self.log.steps),
            evaluator.evaluations,
            evaluator.hulls_built,
            evaluator.hulls_reused,
        )

    def _go_with_tries(self, options: PaperOptions, seed: int) -> None:
        """Take steps with momentum and a line search from the best, and hop from there if need
        be."""
        random, steps = np.random.default_rng([seed, 1]), options.steps
        self._go_with_momentum(steps)
        self._improve_best(steps)
        for hop in range(options.hops):
            if self._is_good:
                break
            best, size = self.best, HOP_NOISE * HOP_GROWTH**hop
            hull, coordinates = best.rests.hull, best.objective.coordinates
            points = coordinates.prune(best.parameters, best.rests).reshape(-1, 3)
            if len(points) < FEW_VERTICES:
                once = hull.tail < hull.head
                middles = 0.5 * (points[hull.tail[once]] + points[hull.head[once]])
                points = np.concatenate([points, middles])
            noise = size * random.normal(size=points.shape)
            shaken = best.objective.attempt((points + noise).ravel(), best.directions)
            if shaken is not None:
                self._record(shaken.refresh())
                self._go_with_momentum(round(HOP_STEPS * steps))
                self._improve_best(steps)

    @property
    def _is_good(self) -> bool:
        best = self.best
        angles = angle_between(best.directions[:, None], best.directions)
        least = angles[np.triu_indices(len(angles), 1)].min(initial=np.pi)
        return best.clusters.empty == 0 and best.error <= GOOD_ERROR and least >= GOOD_ANGLE

    def _improve_best(self, steps: int) -> None:
        """Go to the best evaluation, and on from there by a line search unless it is good."""
        if not self._is_good:
            self.current = self.best.weighted(fade_weights(self.weights, 1.0))
            self._go_by_line_search(min(steps, MAX_LINE_SEARCH_STEPS))
        if self.current is not self.best:
            self._record(self.best)

    def _go_with_momentum(self, steps: int) -> None:
        rule, number = Momentum(steps), 0
        while number < steps:
            if number % FADE_STEPS == 0:
                if self.current.clusters.empty > 0:
                    assigned = assign_facets(self.current)
                    if assigned.clusters.empty <= self.current.clusters.empty:
                        self.current = assigned
                self.current = self.current.weighted(fade_weights(self.weights, number / steps))
            following = rule.search(self.current, self._ascent())
            if following is None:
                break
            self._record(following)
            number = rule.evaluations

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
            # Without points that are no longer vertices.
            objective = following.objective
            pruned = objective.coordinates.prune(following.parameters, following.rests)
            if len(pruned) != len(following.parameters):
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
        if self.current is not best:
            self._record(best)
        return status

    def _ascent(self) -> Floats:
        return self.sobolev.of(self.current.gradient, self.current.rests.hull)

    def _record(self, current: Evaluation) -> None:
        """Continue from an evaluation, which is a step."""
        self.current = current
        if _rank(current) < _rank(self.best):
            self.best = current
        self.log.record(current.energy.terms, current.error, current)


ABSORBED = (0.0, 1.0, 3.0, 6.0, 10.0, 15.0)
"""Angles in degrees within which facets near the facet of an outcome are merged with it, tried one
after the other."""

SAME_FACET = 2.0
"""Angle in degrees within which the rests of an outcome are always merged."""

SUNK = 0.97
"""Height of a half-space for an outcome without a rest, over the height of the shape."""

REPAIRING = EnergyWeights(
    coplanar=0.0, barycenter=0.0, neighbor=0.0, hold=0.1, hold_margin=0.03, clear=0.1
)
"""Weights of a descent to a shape with one rest for each outcome and no other."""

MOST_REPAIRS = 150
"""Limit on the steps of this descent."""

KEPT_ANGLE = 0.35
"""Least angle between two outcomes, in radians (20 degrees), that the exact method tries to
keep."""


def finish_exactly(
    result: DesignResult,
    target: Floats,
    options: PaperOptions,
    center_of_mass: Floats | None = None,
    log: StepLog | None = None,
    outcome_of: Integers | None = None,
) -> DesignResult:
    """Continue a result to probabilities (k,) exact to `options.tolerance`, and improve the die by
    `options.prefer`. If that fails, the die stays as it is.

    log: log of the result, which is continued, if there is one. outcome_of: see `solve_paper`.
    """
    before, maker = result.history[-1], CandidateMaker(center_of_mass, outcome_of=outcome_of)
    log = log or StepLog(steps=list(result.history))
    exact = ExactOptions(tolerance=options.effective_tolerance, prefer=options.prefer)
    best = result
    with suppress(NoStartError):
        search = ExactSearch(target, exact, maker, log, least_angle=KEPT_ANGLE)
        end = search.run(_starts(result, target, maker))
        if end.status is Status.CONVERGED:
            best = end
    if best is result and len(log.steps) > len(result.history):
        log.record(before.terms, before.error)
    return replace(
        best,
        history=tuple(log.steps),
        evaluations=result.evaluations + maker.evaluations,
        hulls_built=result.hulls_built + maker.hulls_built,
        hulls_reused=result.hulls_reused + maker.hulls_reused,
        starts=result.starts,
    )


def _starts(result: DesignResult, target: Floats, maker: CandidateMaker) -> Iterator[Start]:
    """Yield shapes near a result with one rest for each outcome and no other."""
    center = maker.center_of_mass
    poses = analyze(result.hull, result.hull.centroid if center is None else center)
    for angle in ABSORBED:
        coordinates, parameters, directions = flatten(poses, result.directions, angle)
        if np.isnan(parameters).any():
            continue
        candidate = maker.attempt(coordinates, parameters, directions)
        if candidate is None:
            objective = Objective(coordinates, target, REPAIRING, maker, maker.outcome_of)
            candidate = _repair(objective, parameters, directions, maker)
        if candidate is not None:
            yield Start(candidate.rests.hull.vertices, candidate.directions)


def _repair(
    objective: Objective, parameters: Floats, directions: Floats, maker: CandidateMaker
) -> Candidate | None:
    """Descend to a die with one rest for each outcome and no other; None if there is none on the
    way."""
    rule, current = LineSearch(), objective.attempt(parameters, directions)
    for _ in range(MOST_REPAIRS):
        following = current and rule.search(current, current.gradient)
        if following is None:
            break
        current = following.refresh()
        if current.flaws == 0:
            candidate = maker.attempt(objective.coordinates, current.parameters, current.directions)
            if candidate is not None:
                return candidate
    return None


def flatten(
    poses: RestPoses, directions: Floats, angle: float
) -> tuple[FacetCoordinates, Floats, Floats]:
    """Half-spaces of a shape with one facet for each outcome.

    The normal of this facet is the mean normal of the outcome's rests near the most probable one,
    weighted by probability. Its height is the mean height of their corners.

    Parameters
    ----------
    poses: rests of the shape.
    directions: (k, 3) unit directions of the outcomes.
    angle: angle in degrees within which other facets are merged with the nearest outcome's.

    Returns coordinates about the center of mass, their parameters, of which the first k half-spaces
    are the outcomes', and the normals (k, 3) of these.
    """
    hull, center = poses.hull, poses.center_of_mass
    of_rest = cluster(poses.normals, directions).of_rest
    replaced = np.zeros(len(hull.normals), dtype=bool)
    mains, normals, distances = directions.copy(), [], []
    # Rests are sorted by descending probability.
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
