"""Dice of the exact method, and Levenberg-Marquardt steps from a die to target probabilities.

A die has several parameters for each outcome, so the equations p = q have many solutions. The
shortest step to one is `-W^-1 J^T (J W^-1 J^T + mu I)^-1 r` in a metric W. Probabilities jump where
a facet gains or loses stability. So the depths of facets near that edge are residuals too, which
fade out at the end, and a step that changes which facets are rests is refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.gradient.facet_measures import circle_radii
from dicedesign.gradient.probability_model import RESTING, ProbabilityModel
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.kernels.ops import Tie
from dicedesign.optimize.coordinates import Coordinates, Shape, ShapeEvaluator
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.descent import SobolevGradient
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats, Integers


@dataclass(frozen=True)
class DesignStep:
    """One accepted step: seconds since the start, weighted energy terms, largest |p - q|."""

    step: int
    seconds: float
    energy: float
    terms: dict[str, float]
    error: float


@dataclass
class StepLog:
    """Accepted steps of a design, and callbacks.

    Attributes
    ----------
    on_step: called after every step.
    on_shape: called before that with the evaluation or candidate of the step.
    steps: so far; the first is the start.
    started: time of the start, by `time.perf_counter`.
    """

    on_step: Callable[[DesignStep], None] | None = None
    on_shape: Callable[[Any], None] | None = None
    steps: list[DesignStep] = field(default_factory=list)
    started: float = field(default_factory=lambda: time.perf_counter())

    @property
    def seconds(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.started

    def record(self, terms: dict[str, float], error: float, shape: Any = None) -> None:
        """Add a step. shape: for `on_shape`, if it is new."""
        step = DesignStep(len(self.steps), self.seconds, sum(terms.values()), terms, error)
        self.steps.append(step)
        if self.on_shape is not None and shape is not None:
            self.on_shape(shape)
        if self.on_step is not None:
            self.on_step(step)


@dataclass(frozen=True)
class DesignResult:
    """End of a design.

    Attributes
    ----------
    status: why it stopped.
    hull: the designed shape.
    directions: (f, 3) directions of the outcomes' faces.
    error: largest |p - q|, by the probabilities that the design is for.
    terms: energy terms of the hull, weighted.
    history: accepted steps; the first is the start.
    evaluations: dice tried, with rejected and pruned ones.
    hulls_built: hulls that were computed from scratch, with polar hulls of facet coordinates.
    hulls_reused: hulls that kept the connectivity of the previous one; the result is identical.
    starts: starting shapes tried.
    """

    status: Status
    hull: ConvexHull
    directions: Floats
    error: float
    terms: dict[str, float]
    history: tuple[DesignStep, ...]
    evaluations: int
    hulls_built: int
    hulls_reused: int
    starts: int = 1


@dataclass(frozen=True)
class Candidate:
    """A die with one rest for each labeled face and no other.

    Attributes
    ----------
    coordinates: meaning of its parameters.
    parameters: (n,).
    shape: shape made of the parameters.
    rests: rests of the shape.
    rest_of_face: (f,) number of the rest of each face.
    model: of the probabilities.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    """

    coordinates: Coordinates
    parameters: Floats
    shape: Shape
    rests: RestEvaluation
    rest_of_face: Integers
    model: ProbabilityModel = RESTING
    outcome_of: Integers | None = None

    @property
    def outcome_facets(self) -> Integers:
        """(f,) facets of the faces of all outcomes."""
        return self.rests.facets[self.rest_of_face]

    @property
    def directions(self) -> Floats:
        """(f, 3) normals of these facets."""
        return self.rests.hull.normals[self.outcome_facets]

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) probabilities of the outcomes."""
        return self._by_outcome(self.model.probabilities(self.rests)[self.rest_of_face])

    @cached_property
    def signed_depths(self) -> Tensor:
        """(m,) depths of the facets (`RestEvaluation.facet_depths`), negated for other facets than
        rests: positive as long as facets keep or lack stability as they should."""
        sign = np.full(len(self.rests.hull.normals), -1.0)
        sign[self.outcome_facets] = 1.0
        return torch.as_tensor(sign) * self.rests.facet_depths

    @cached_property
    def least_circle(self) -> float:
        """Radius of the largest circle in the facet of an outcome, over the diameter of the hull;
        the least of all outcomes."""
        return float(circle_radii(self.rests, self.outcome_facets).detach().min())

    def error(self, target: Floats) -> float:
        """Largest |p - q| for target probabilities (k,)."""
        return float(np.abs(self.probabilities - target).max())

    def dice_energy(self, target: Floats) -> float:
        """Sum of (p - q)^2 over the outcomes, for target probabilities (k,) (eq. 12)."""
        return float(((self.probabilities - target) ** 2).sum())

    @cached_property
    def probability_jacobian(self) -> Floats:
        """(k, n) Jacobian of the probabilities in the parameters."""
        rows = self._by_outcome(self.model.jacobian(self.rests)[self.rest_of_face])
        return self.shape.in_parameters(rows, self.rests.hull.source)

    def _by_outcome(self, of_faces: Floats) -> Floats:
        """Sums (k, ...) of values (f, ...) over the faces of each outcome."""
        if self.outcome_of is None:
            return of_faces
        sums = np.zeros((self.outcome_of.max() + 1, *of_faces.shape[1:]))
        np.add.at(sums, self.outcome_of, of_faces)
        return sums

    def jacobian(self, *values: Tensor) -> Floats:
        """(r, n) Jacobian of the entries of some vectors, r in all, in the parameters, by one
        backward pass for each entry."""
        vertices, rows = self.rests.vertices, []
        for vector in values:
            for number in range(len(vector)):
                # Without a gradient of the value, whose check would import much.
                (gradient,) = torch.autograd.grad(vector[number], vertices, retain_graph=True)
                rows.append(gradient.numpy().ravel())
        stacked = np.array(rows).reshape(-1, vertices.numel())
        return self.shape.in_parameters(stacked, self.rests.hull.source)


@dataclass
class CandidateMaker(ShapeEvaluator):
    """Makes candidates.

    Attributes
    ----------
    model: of the probabilities.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    """

    model: ProbabilityModel = RESTING
    outcome_of: Integers | None = None

    def attempt(
        self, coordinates: Coordinates, parameters: Floats, directions: Floats
    ) -> Candidate | None:
        """Make a candidate; None if the parameters make no die with the right rests, or a tied die,
        whose probabilities jump.

        parameters: (n,) of the coordinates; directions: (f, 3) near the normals of the outcomes'
        facets.
        """
        try:
            shape, rests = self.evaluate(coordinates, parameters)
            rests = rests.raise_ties()
            nearest = np.argmax(directions @ rests.hull.normals[rests.facets].T, axis=1)
            if not np.array_equal(np.sort(nearest), np.arange(len(rests.facets))):
                return None
            die = coordinates, parameters, shape, rests, nearest
            candidate = Candidate(*die, self.model, self.outcome_of)
            return candidate if np.isfinite(candidate.probabilities).all() else None
        except (DiceError, Tie, np.linalg.LinAlgError):
            return None

    def move(self, candidate: Candidate, parameters: Floats) -> Candidate | None:
        """Make a candidate with other parameters; see `attempt`."""
        return self.attempt(candidate.coordinates, parameters, candidate.directions)


DEPTH_MARGIN = 0.03
"""Depth of a facet, over the circumscribed radius, below which it is a residual."""

WALL_WEIGHTS = (0.3, 0.01, 0.0)
"""Weights of the depth residuals, in order."""

NEAR = 0.002
"""Largest |p - q| of a die that is first led to the target without depth residuals, as a short way
rarely meets an edge of stability."""

LARGEST_MOVE = 0.15
"""Largest change of a parameter in one step."""

DAMPINGS = (1e-14, 1e-3, 1e4)
"""Smallest, first and largest damping mu, in units of the mean square of the Jacobian's rows."""

LEAST_REFUSED = 1e-6
"""Least damping after a refused step, in the units of `DAMPINGS`."""

SAME = 1e-12
"""Largest difference of the cosine of a zero angle from 1."""

SLOW = 0.1
"""Relative decrease of the squared residuals below which the next weight is used."""

MOST_STEPS = 80
"""Limit on the steps from one die."""


@dataclass(frozen=True)
class LevenbergMarquardt:
    """Levenberg-Marquardt steps from a die to target probabilities.

    Attributes
    ----------
    target: (k,) target probabilities.
    maker: makes the dice that are tried.
    tolerance: largest |p - q| to end with.
    sobolev: metric `(I + lambda L)^p` of steps of vertices; None for the Euclidean metric.
    least_angle: least angle in radians between the facets of two outcomes; smaller angles are
        residuals until the end. 0 for none.
    out_of_time: called before every step.
    on_candidate: called with the first die and the die after every step.
    """

    target: Floats
    maker: CandidateMaker
    tolerance: float
    sobolev: SobolevOptions | None = None
    least_angle: float = 0.0
    out_of_time: Callable[[], bool] = lambda: False
    on_candidate: Callable[[Candidate], None] = lambda candidate: None

    def solve(self, first: Candidate) -> Candidate:
        """Die after the last step, within the tolerance or not."""
        current, metric = first, SobolevGradient(self.sobolev)
        self.on_candidate(current)
        near = current.error(self.target) < NEAR
        weights = iter((0.0, *WALL_WEIGHTS) if near else WALL_WEIGHTS)
        weight, damping = next(weights), DAMPINGS[1]
        for _ in range(MOST_STEPS):
            if current.error(self.target) <= self.tolerance or self.out_of_time():
                break
            following, gained, damping = self._step(current, metric, weight, damping)
            if following is not None:
                current = self._prune(following)
                self.on_candidate(current)
                if gained >= SLOW:
                    continue
            weight, damping = next(weights, -1.0), DAMPINGS[1]
            if weight < 0.0:
                break
        return current

    def _step(
        self, current: Candidate, metric: SobolevGradient, weight: float, damping: float
    ) -> tuple[Candidate | None, float, float]:
        """Acceptable candidate or None, its relative decrease of the squared residuals, and the
        damping for the next step."""
        residuals, walls = self._residuals(current, weight)
        jacobian = current.probability_jacobian
        if walls:
            jacobian = np.concatenate([jacobian, current.jacobian(*walls)])
        raised = metric.of(jacobian.T, current.rests.hull)
        square = jacobian @ raised
        unit = float(np.trace(square)) / len(residuals)
        merit = float((residuals**2).sum())
        while damping <= DAMPINGS[2] and np.isfinite(unit) and unit > 0.0:
            damped = square + damping * unit * np.eye(len(residuals))
            step = -raised @ np.linalg.solve(damped, residuals)
            largest = float(np.abs(step).max())
            if not 0.0 < largest < np.inf:
                break
            step *= min(1.0, LARGEST_MOVE / largest)
            candidate = self.maker.move(current, current.parameters + step)
            if candidate is not None:
                left = float((self._residuals(candidate, weight)[0] ** 2).sum())
                if left < merit:
                    return candidate, 1.0 - left / merit, max(0.1 * damping, DAMPINGS[0])
            damping = max(10.0 * damping, LEAST_REFUSED)
        return None, 0.0, damping

    def _residuals(self, candidate: Candidate, weight: float) -> tuple[Floats, list[Tensor]]:
        """Residuals (r,): p - q, and for a weight above 0 the lack of depth of facets near the edge
        of stability, and the lack of distance of outcomes near each other. Also tensors with the
        derivatives of the latter two."""
        misses = candidate.probabilities - self.target
        if weight == 0.0:
            return misses, []
        depths = candidate.signed_depths
        near = depths[depths.detach() < DEPTH_MARGIN]
        numbers = [misses, weight * (1.0 - near.detach().numpy() / DEPTH_MARGIN)]
        tensors = [-weight / DEPTH_MARGIN * near]
        # Range of the cosines of a pair whose residual falls from 1 to 0.
        falling = max(1.0 - float(np.cos(self.least_angle)), SAME)
        cosines = np.triu(candidate.directions @ candidate.directions.T, 1)
        crowded = np.stack(np.nonzero(cosines > 1.0 - falling))
        if self.least_angle > 0.0 and crowded.size > 0:
            first, second = candidate.directions[crowded]
            crowding = (first * second).sum(1) - np.cos(self.least_angle)
            numbers.append(weight * (crowding / falling))
            normals = candidate.rests.facet_normals(candidate.outcome_facets)
            cosine = (normals[crowded[0]] * normals[crowded[1]]).sum(1)
            tensors.append(weight / falling * cosine)
        return np.concatenate(numbers), tensors

    def _prune(self, candidate: Candidate) -> Candidate:
        """Remove parameters that the shape can never use again."""
        pruned = candidate.coordinates.prune(candidate.parameters, candidate.rests)
        if len(pruned) == len(candidate.parameters):
            return candidate
        return self.maker.move(candidate, pruned) or candidate
