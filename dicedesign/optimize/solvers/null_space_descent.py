"""Improve a die by preferences while its probabilities stay as they are.

A die has more parameters than outcomes, so the dice with given probabilities form a manifold
p = q. There BFGS minimizes a sum of squared residuals; it copes with the kinks that a shape has
where its edges change. A step goes along the tangent space of the manifold, the null space of the
Jacobian of the probabilities, and Newton's method leads back to the manifold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.facet_measures import SOFTNESS, FacetEdges, circle_radii
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.optimize.preferences import OutcomeFacets, Preferences, preference_residuals
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker
from dicedesign.runtime.arrays import Floats

SHORTFALL = 0.2
"""Relative lack of a circle's radius that is a residual of 1."""

ROOM = 1.01
"""Factor on the least radius below which a circle has a residual."""

LARGEST_MOVE = 0.15
"""Largest change of a parameter along the manifold in one step."""

MOST_ROWS = 600
"""Largest number of residuals whose Jacobian is computed."""

RANK = 1e-9
"""Singular values of the Jacobian of the probabilities that count as zero. Parameters are about 1;
probabilities sum to 1, and symmetry may make more of them depend on each other, or all."""

DAMPING = 1.0
"""Damping of the first Gauss-Newton matrix of BFGS, in units of its mean eigenvalue."""

SUFFICIENT = 1e-4
"""Armijo constant: least decrease of an accepted step, over the decrease by its slope."""

SHORTER = 0.4
"""Ratio of successive step lengths in a line search."""

MOST_LENGTHS = 12
"""Limit on the step lengths in a line search."""

MOST_CORRECTIONS = 6
"""Limit on the Newton steps back to the manifold."""

CONVERGING = 0.3
"""Largest ratio of the errors before and after a Newton step; above it the move is too long."""

CURVED = 1e-10
"""Least cosine between a step and the change of the gradient for an update of the Hessian."""

SLOW = 5e-4
"""Relative decrease of the sum of squares below which a step is slow."""

PATIENCE = 5
"""Limit on successive slow steps."""


BARRIER_DEPTH = 0.01
"""Depth of a facet, over the mean distance of the vertices, at which its barrier is 1."""


def barrier_residuals(rests: RestEvaluation) -> Tensor:
    """(m,) inverse depths of the facets, infinite where a facet gains or loses stability: a barrier
    that keeps rests and other facets what they are.

    The depth of a rest is the least distance of the foot of the center of mass from the lines of
    its edges. The depth of another facet is the largest distance of the foot outside of these
    lines. Means of high power over the border make both smooth.
    """
    edges = FacetEdges.of(rests, np.arange(len(rests.hull.normals)))
    inside = edges.distances(rests.center_of_mass)
    stable = torch.as_tensor(rests.equilibria.stable)
    held = edges.mean_power(torch.where(stable[edges.owner], inside, 1.0), -SOFTNESS)
    outside = torch.where(stable[edges.owner], 1.0, torch.relu(-inside))
    depths = torch.where(stable, held, edges.mean_power(outside, SOFTNESS))
    size = torch.linalg.vector_norm(rests.vertices - rests.center_of_mass, dim=1).mean()
    return BARRIER_DEPTH * size / depths


@dataclass(frozen=True)
class NullSpaceDescent:
    """Steps that improve a die by preferences.

    Every step keeps the probabilities within the tolerance, and one rest for each outcome and no
    other. No facet comes near to gaining or losing stability.

    Attributes
    ----------
    target: (k,) probabilities.
    maker: makes the dice that are tried.
    preferences: weights of the objectives.
    least_circle: least radius of the largest circle in the facet of each outcome, over the hull's
        diameter; 0 for none. While a circle is smaller, only this is improved; then all circles
        stay as large.
    tolerance: largest |p - q|.
    out_of_time: called before every step.
    on_step: called with the die of every step and the sum of squares that is minimized: weighted
        preferences, the barrier of stability and the lack of circles.
    """

    target: Floats
    maker: CandidateMaker
    preferences: Preferences
    least_circle: float
    tolerance: float
    out_of_time: Callable[[], bool]
    on_step: Callable[[Candidate, float], None]

    def improve(self, candidate: Candidate, steps: int) -> Candidate:
        """Best die to which steps lead from a die with probabilities within the tolerance.

        steps: limit on their number.
        """
        goals = [self]
        if self.least_circle > 0.0:
            # Circles that are too small come first.
            goals.insert(0, replace(self, preferences=Preferences()))
        for goal in goals:
            point, slow = _Point(goal, candidate), 0
            # If no direction keeps the probabilities, there is nothing to improve.
            curvature = point.gauss_newton() if point.is_open and len(point.free) > 0 else None
            while curvature is not None and steps > 0 and slow < PATIENCE:
                if not point.is_open or self.out_of_time():
                    break
                following = _line_search(point, curvature)
                if following is None:
                    # Curvature from beyond a kink is wrong.
                    curvature = point.gauss_newton()
                    following = _line_search(point, curvature)
                if following is None:
                    break
                curvature = _update(curvature, point, following)
                slow = slow + 1 if following.merit > (1.0 - SLOW) * point.merit else 0
                point, steps = following, steps - 1
                self.on_step(point.candidate, point.merit)
            candidate = point.candidate
        return candidate


@dataclass(frozen=True)
class _Point:
    """A die and its objective."""

    goal: NullSpaceDescent
    candidate: Candidate

    @cached_property
    def residuals(self) -> list[Tensor]:
        """Vectors whose sum of squares is minimized."""
        goal, rests, facets = self.goal, self.candidate.rests, self.candidate.outcome_facets
        die = OutcomeFacets(rests, facets, self.candidate.model)
        parts = [
            *preference_residuals(die, goal.preferences),
            np.sqrt(goal.preferences.largest or 1.0) * barrier_residuals(rests),
        ]
        if goal.least_circle > 0.0:
            radii = circle_radii(rests, facets)
            parts.append(torch.relu(ROOM * goal.least_circle / radii - 1.0) / SHORTFALL)
        return parts

    @cached_property
    def _squares(self) -> Tensor:
        """() sum of the squares of `residuals`."""
        return torch.stack([vector @ vector for vector in self.residuals]).sum()

    @cached_property
    def merit(self) -> float:
        """Sum of the squares of `residuals`."""
        return self._squares.item()

    @property
    def is_short(self) -> bool:
        """Whether a circle is too small."""
        least = self.goal.least_circle
        return least > 0.0 and self.candidate.least_circle < least

    @property
    def is_open(self) -> bool:
        """Whether there is anything to improve."""
        return self.goal.preferences.largest > 0.0 or self.is_short

    @cached_property
    def _singular(self) -> tuple[Floats, Floats, Floats]:
        """Singular value decomposition of the Jacobian (k, n) of the probabilities: left vectors
        (k, r), values (r,), all right vectors (n, n)."""
        left, values, right = np.linalg.svd(self.candidate.probability_jacobian)
        rank = int((values > RANK).sum())
        return left[:, :rank], values[:rank], right

    @property
    def free(self) -> Floats:
        """(n - r, n) orthonormal directions that keep the probabilities."""
        _, values, right = self._singular
        return right[len(values) :]

    def along(self, vector: Floats) -> Floats:
        """(n,) part of a vector (n,) along the manifold."""
        return self.free.T @ (self.free @ vector)

    @cached_property
    def gradient(self) -> Floats:
        """(n,) gradient of the merit along the manifold."""
        return self.along(self.candidate.jacobian(self._squares[None])[0])

    def gauss_newton(self) -> Floats:
        """(n, n) inverse of the damped Gauss-Newton matrix of the merit along the manifold. For
        more than `MOST_ROWS` residuals a multiple of the identity, which needs no Jacobian."""
        free = self.free
        if sum(map(len, self.residuals)) > MOST_ROWS:
            steepness = max(float(np.linalg.norm(self.gradient)), np.finfo(np.float64).tiny)
            return free.T @ free * (LARGEST_MOVE / steepness)
        jacobian = self.candidate.jacobian(*self.residuals) @ free.T
        square = 2.0 * (jacobian.T @ jacobian)
        damping = DAMPING * max(float(np.trace(square)), np.finfo(np.float64).tiny)
        return free.T @ np.linalg.solve(square + damping / len(free) * np.eye(len(free)), free)

    def move_along(self, move: Floats) -> _Point | None:
        """Point after a move (n,) along the tangent space and Newton's method back to the manifold;
        None if there is no such die, or a circle becomes too small."""
        goal, before = self.goal, np.inf
        parameters = self.candidate.parameters + move
        for _ in range(MOST_CORRECTIONS + 1):
            candidate = goal.maker.move(self.candidate, parameters)
            if candidate is None:
                return None
            following, error = _Point(goal, candidate), candidate.error(goal.target)
            if error <= goal.tolerance:
                return None if following.is_short and not self.is_short else following
            if error > CONVERGING * before:
                return None
            before = error
            left, values, right = following._singular
            across = (left.T @ (candidate.probabilities - goal.target)) / values
            parameters = parameters - right[: len(values)].T @ across
        return None


def _line_search(point: _Point, curvature: Floats) -> _Point | None:
    """Point that is better by the Armijo condition, in the quasi-Newton direction."""
    direction = -point.along(curvature @ point.gradient)
    slope = float(direction @ point.gradient)
    if not slope < 0.0:
        return None
    length = min(1.0, LARGEST_MOVE / float(np.abs(direction).max()))
    for _ in range(MOST_LENGTHS):
        following = point.move_along(length * direction)
        if following is not None and following.merit <= point.merit + SUFFICIENT * length * slope:
            return following
        length *= SHORTER
    return None


def _update(curvature: Floats, point: _Point, following: _Point) -> Floats:
    """BFGS update of the inverse Hessian (n, n), with vectors projected into the new tangent
    space."""
    step = following.along(following.candidate.parameters - point.candidate.parameters)
    change = following.gradient - following.along(point.gradient)
    product = float(step @ change)
    if product <= CURVED * np.linalg.norm(step) * np.linalg.norm(change):
        return curvature
    keep = np.eye(len(step)) - np.outer(step, change) / product
    return keep @ curvature @ keep.T + np.outer(step, step) / product
