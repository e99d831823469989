"""Dice of the exact method, each at one set of parameters, and Levenberg-Marquardt steps from one
to wanted probabilities.

A die has several parameters for each outcome, so the equations p = q have many solutions, and the
shortest step to one is taken: `-W^-1 J^T (J W^-1 J^T + mu I)^-1 r` in a metric W. Probabilities
jump where a facet gains or loses stability, so depths of facets near that edge are residuals too,
which fade out at the end, and a step that changes which facets are rests is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull, HullMemory, convex_hull
from dicedesign.gradient.facet_measures import SOFTNESS, FacetEdges, circle_radii
from dicedesign.gradient.probability_model import ProbabilityModel
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.kernels.ops import Tie
from dicedesign.optimize.coordinates import Coordinates, Shape
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.descent import SobolevGradient
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import analyze
from dicedesign.rest.prior import Prior
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


@dataclass(frozen=True)
class DesignResult:
    """End of a design.

    Attributes
    ----------
    status: why it stopped.
    hull: the designed shape.
    directions: (k, 3) where the outcomes are.
    error: its largest |p - q|, by the probabilities that the method is about.
    terms: the energy's terms of the hull, with their full weights.
    history: every accepted step, the first being the start.
    evaluations: dice tried, rejected ones and those after pruning included.
    hulls_built: hulls computed for them from scratch, polar hulls of facet coordinates included.
    hulls_reused: hulls that only moved the vertices of the one before, for the same result.
    starts: starting shapes that were tried.
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
    """A die with one rest for each outcome and no other.

    Attributes
    ----------
    coordinates: what its parameters mean.
    parameters: (n,).
    shape: what they make.
    rests: the die.
    rest_of_outcome: (k,) index into the die's rests of each outcome.
    model: of its probabilities, where it is thrown or let go under a prior; None where they are
        those without momentum, with uniform start orientations.
    """

    coordinates: Coordinates
    parameters: Floats
    shape: Shape
    rests: RestEvaluation
    rest_of_outcome: Integers
    model: ProbabilityModel | None = None

    @property
    def outcome_facets(self) -> Integers:
        """(k,) facet of each outcome."""
        return self.rests.paths.rests[self.rest_of_outcome]

    @property
    def directions(self) -> Floats:
        """(k, 3) normals of those facets."""
        return self.rests.hull.normals[self.outcome_facets]

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) probabilities of the outcomes."""
        probabilities = (
            self.rests.probability_values
            if self.model is None
            else self.model.probabilities(self.rests)
        )
        return probabilities[self.rest_of_outcome]

    @cached_property
    def signed_depths(self) -> Tensor:
        """(m,) how surely each facet is what it is, a rest or none: its depth
        (`RestEvaluation.facet_depths`), with the other sign for facets that are no rests."""
        sign = np.full(len(self.rests.hull.normals), -1.0)
        sign[self.outcome_facets] = 1.0
        return torch.as_tensor(sign) * self.rests.facet_depths

    @cached_property
    def least_circle(self) -> float:
        """Radius, over the diameter, of the smallest of the largest circles in the outcomes'
        facets."""
        return float(circle_radii(self.rests, self.outcome_facets).detach().min())

    def error(self, target: Floats) -> float:
        """Largest |p - q| for target probabilities (k,)."""
        return float(np.abs(self.probabilities - target).max())

    def dice_energy(self, target: Floats) -> float:
        """Sum of (p - q)^2 over the outcomes, for target probabilities (k,) (eq. 12)."""
        return float(((self.probabilities - target) ** 2).sum())

    @cached_property
    def probability_jacobian(self) -> Floats:
        """(k, n) Jacobian of the probabilities in the parameters, in one sweep."""
        rests = self.rests
        rows = rests.jacobian if self.model is None else self.model.jacobian(rests)
        return self.shape.in_parameters(rows[self.rest_of_outcome], rests.hull.source)

    def jacobian(self, *values: Tensor) -> Floats:
        """(r, n) derivatives of the values of vectors, r in all, in the parameters, with one
        backward pass for each."""
        vertices, rows = self.rests.vertices, []
        for vector in values:
            for number in range(len(vector)):
                # One value, whose own gradient is 1: torch imports much to check a given one.
                (gradient,) = torch.autograd.grad(vector[number], vertices, retain_graph=True)
                rows.append(gradient.numpy().ravel())
        stacked = np.array(rows).reshape(-1, vertices.numel())
        return self.shape.in_parameters(stacked, self.rests.hull.source)


@dataclass
class CandidateMaker:
    """Makes candidates, and remembers the hulls of the last ones.

    Attributes
    ----------
    center_of_mass: (3,) fixed, or None for that of the uniform solid.
    model: see `Candidate`.
    offset: (3,) of the center of mass from that of the uniform solid, where it is not fixed.
    evaluations: how many candidates were asked for.
    shapes, polars: memories of the hulls of dice, and of those that coordinates need.
    """

    center_of_mass: Floats | None
    model: ProbabilityModel | None = None
    offset: Floats | None = None
    evaluations: int = 0
    shapes: HullMemory = field(default_factory=HullMemory)
    polars: HullMemory = field(default_factory=HullMemory)

    def attempt(
        self, coordinates: Coordinates, parameters: Floats, directions: Floats
    ) -> Candidate | None:
        """A candidate, or None where the parameters make no die with the wanted rests, or one that
        is tied: the probabilities of a tied body jump.

        parameters: (n,) of the coordinates; directions: (k, 3) near which each outcome's facet is.
        """
        self.evaluations += 1
        given = self.center_of_mass
        try:
            shape = coordinates.shape(parameters, self.polars.hull)
            points = torch.from_numpy(shape.points).requires_grad_()
            center = None if given is None else torch.as_tensor(given)
            rests = evaluate_rests(points, center, self.shapes.hull, self.offset).raise_ties()
            stable = rests.hull.normals[rests.paths.rests]
            nearest = np.argmax(directions @ stable.T, axis=1)
            if not np.array_equal(np.sort(nearest), np.arange(len(stable))):
                return None
            candidate = Candidate(coordinates, parameters, shape, rests, nearest, self.model)
            return candidate if np.isfinite(candidate.probabilities).all() else None
        except (DiceError, Tie, np.linalg.LinAlgError):
            return None


BARRIER_DEPTH: Final = 0.01
"""Depth of a facet, over the mean distance of the vertices, at which its barrier is 1."""


def barrier_residuals(rests: RestEvaluation) -> Tensor:
    """(m,) inverse depths of the facets, infinite where a facet gains or loses stability: a barrier
    that keeps every facet what it is, a rest or none.

    The depth of a rest is the distance of the foot of the center of mass from the nearest edge's
    line, that of another facet how far outside of the farthest such line it lies; for both a mean
    of high power over the facet's border takes the place of the least or largest, so that depths
    are smooth.
    """
    edges = FacetEdges.of(rests, np.arange(len(rests.hull.normals)))
    inside = edges.distances(rests.center)
    stable = torch.as_tensor(rests.equilibria.stable)
    held = edges.mean_power(torch.where(stable[edges.owner], inside, 1.0), -SOFTNESS)
    outside = torch.where(stable[edges.owner], 1.0, torch.relu(-inside))
    depths = torch.where(stable, held, edges.mean_power(outside, SOFTNESS))
    size = torch.linalg.vector_norm(rests.vertices - rests.center, dim=1).mean()
    return BARRIER_DEPTH * size / depths


TRIALS: Final = 4

ROUNDED: Final = float(np.finfo(np.float32).eps) / 2.0
"""Largest error of a coordinate in single precision, over its size."""


def largest_jump(candidate: Candidate, target: Floats, prior: Prior) -> float:
    """Largest |p - q| of copies of a die whose corners are off by what a file may be; 1 where one
    is no die. target: (k,) probabilities under a prior."""
    corners, center = candidate.rests.hull.vertices, candidate.rests.given_center
    size, random = float(np.abs(corners).max()), np.random.default_rng(0)
    errors = []
    for _ in range(TRIALS):
        off = ROUNDED * size * random.uniform(-1.0, 1.0, corners.shape)
        try:
            hull = convex_hull(corners + off, single_precision=True)
            poses = analyze(hull, hull.centroid if center is None else center.numpy())
            errors.append(
                outcome_probabilities(poses.under(prior), candidate.directions).error(target)
            )
        except DiceError:
            errors.append(1.0)
    return max(errors)


DEPTH_MARGIN: Final = 0.03
"""Depth of a facet, over the circumscribed radius, below which it is a residual."""

WALL_WEIGHTS: Final = (0.3, 0.01, 0.0)
"""Weights of those residuals, from first to last."""

NEAR: Final = 0.002
"""Largest |p - q| of a die from which on they are no residuals at first: a short way meets no
edge, as a rule."""

LARGEST_MOVE: Final = 0.15
"""Largest change of a parameter in one step."""

DAMPINGS: Final = (1e-14, 1e-3, 1e4)
"""Smallest, first and largest damping mu, in units of the mean square of the Jacobian's rows."""

LEAST_REFUSED: Final = 1e-6
"""Damping in the same units from which on it is raised after a refused step."""

SAME: Final = 1e-12
"""Difference from 1 of a cosine up to which the angle counts as 0: 1e-6 radians."""

SLOW: Final = 0.1
"""Relative decrease of the squared residuals below which the next wall weight's turn has come."""

MOST_STEPS: Final = 80
"""Steps from one die."""


@dataclass(frozen=True)
class LevenbergMarquardt:
    """Steps from a die toward probabilities.

    Attributes
    ----------
    target: (k,) the probabilities.
    maker: makes the dice that are tried.
    tolerance: largest |p - q| wanted.
    sobolev: the metric `(I + lambda L)^p` in which steps of vertices are shortest, or None for
        lengths as they are.
    least_angle: between the facets of two outcomes, in radians; what lies nearer is a residual too
        until the end. 0 for none.
    out_of_time: asked before every step.
    on_candidate: called with the first die and every one that a step leads to.
    """

    target: Floats
    maker: CandidateMaker
    tolerance: float
    sobolev: SobolevOptions | None = None
    least_angle: float = 0.0
    out_of_time: Callable[[], bool] = lambda: False
    on_candidate: Callable[[Candidate], None] = lambda candidate: None

    def solve(self, first: Candidate) -> Candidate:
        """The die where the steps end, within the tolerance or not."""
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
        """An acceptable candidate or None, the part of the squared residuals that it takes away,
        and the damping for the next step."""
        residuals, walls = self._residuals(current, weight)
        jacobian = current.probability_jacobian
        if walls:
            jacobian = np.concatenate([jacobian, current.jacobian(*walls)])
        raised = jacobian.T
        if self.sobolev is not None:
            raised = metric.of(raised, current.rests.hull)
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
            candidate = self._attempt(current, current.parameters + step)
            if candidate is not None:
                left = float((self._residuals(candidate, weight)[0] ** 2).sum())
                if left < merit:
                    return candidate, 1.0 - left / merit, max(0.1 * damping, DAMPINGS[0])
            damping = max(10.0 * damping, LEAST_REFUSED)
        return None, 0.0, damping

    def _residuals(self, candidate: Candidate, weight: float) -> tuple[Floats, list[Tensor]]:
        """(r,) p - q, and with a weight above 0 what facets near the edge lack in depth, and
        outcomes near each other in distance: these also as tensors, but for a constant."""
        misses = candidate.probabilities - self.target
        if weight == 0.0:
            return misses, []
        depths = candidate.signed_depths
        near = depths[depths.detach() < DEPTH_MARGIN]
        numbers = [misses, weight * (1.0 - near.detach().numpy() / DEPTH_MARGIN)]
        tensors = [-weight / DEPTH_MARGIN * near]
        # By how much the cosine of a pair, whose residual falls from 1 to 0, falls from angle 0 to
        # the least one.
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

    def _attempt(self, current: Candidate, parameters: Floats) -> Candidate | None:
        return self.maker.attempt(current.coordinates, parameters, current.directions)

    def _prune(self, candidate: Candidate) -> Candidate:
        """The candidate without the parameters that its shape no longer uses."""
        pruned = candidate.coordinates.prune(candidate.parameters, candidate.rests)
        if len(pruned) == len(candidate.parameters):
            return candidate
        return self._attempt(candidate, pruned) or candidate
