"""Make a die better by one's preferences while its probabilities stay what they are.

A die has more parameters than outcomes, so the dice of the same probabilities form a manifold p =
q. On it the sum of squared residuals is minimized by BFGS, which copes with the kinks that a shape
has where its edges change: a step goes along the tangent space of the manifold, the null space of
    the probabilities'
Jacobian, and Newton's method across brings it back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.facet_measures import circle_radii
from dicedesign.gradient.probability_model import TableSensitivity
from dicedesign.optimize.preferences import OutcomeFacets, Preferences, preference_residuals
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker, barrier_residuals
from dicedesign.runtime.arrays import Floats

SHORTFALL: Final = 0.2
"""Part by which a circle is too small that counts as a residual of 1."""

ROOM: Final = 1.01
"""Circles below this times the least radius count as too small; none falls below that radius."""

FAR: Final = 0.1
"""Root of the mean square change of parameters that counts as 1 for the preference `nearness`."""

LARGEST_MOVE: Final = 0.15
"""Largest change of a parameter along the manifold in one step."""

MOST_ROWS: Final = 600
"""Residuals up to which their Jacobian is worth its time."""

RANK: Final = 1e-9
"""Singular value of the probabilities' Jacobian, whose parameters are about 1 in size, below which
one counts as none: probabilities sum to 1, and symmetry may tie more of them, or all."""

DAMPING: Final = 1.0
"""Damping of the Gauss-Newton matrix that BFGS starts from, in units of its mean eigenvalue."""

SUFFICIENT: Final = 1e-4
"""Part of the decrease that the slope promises with which a step is accepted."""

SHORTER: Final = 0.4
"""Factor between the lengths that are tried in one direction."""

MOST_LENGTHS: Final = 12
"""How many lengths are tried."""

MOST_CORRECTIONS: Final = 6
"""Newton steps back to the manifold."""

CONVERGING: Final = 0.3
"""Factor by which each of them must reduce the error; a move that is worse is too long."""

CURVED: Final = 1e-10
"""Cosine between a step and the change of the gradient from which on the two teach curvature."""

SLOW: Final = 5e-4
"""Relative decrease of the sum of squares that counts as slow."""

PATIENCE: Final = 5
"""Slow steps in a row after which nothing more is to be gained."""


def improve(
    candidate: Candidate,
    target: Floats,
    maker: CandidateMaker,
    preferences: Preferences,
    *,
    sensitivity: TableSensitivity | None = None,
    least_circle: float,
    tolerance: float,
    steps: int,
    out_of_time: Callable[[], bool],
    on_step: Callable[[Candidate, float], None],
) -> Candidate:
    """The best die that steps from a given one lead to, by weighted preferences.

    Every step keeps the probabilities within the tolerance, one rest for each outcome and no other.
    No facet of an outcome comes near to losing its stability, or another to gaining it.

    Parameters
    ----------
    candidate: a die whose probabilities are within the tolerance.
    target: (k,) the probabilities.
    maker: makes the dice that are tried.
    preferences: what is made better.
    sensitivity: of the probabilities when thrown, or None for probabilities without momentum.
    least_circle: radius, over the hull's diameter, that the largest circle in each facet of an
        outcome shall have, 0 for any. While one has less, steps are toward that alone; once all
        have it they keep it.
    tolerance: largest |p - q|.
    steps: most steps.
    out_of_time: asked before every step.
    on_step: called with every die that a step leads to, and the sum of squares that falls: weighted
        preferences, and what keeps facets from the verge of tipping and circles from being small.
    """
    goal = _Goal(
        target, maker, preferences, sensitivity, least_circle, tolerance, candidate.parameters
    )
    goals = [goal]
    if least_circle > 0.0:
        # A circle that is too small comes first, and alone.
        goals.insert(0, replace(goal, preferences=Preferences()))
    for goal in goals:
        point, slow = _Point(goal, candidate), 0
        # Where no direction leaves the probabilities as they are, there is nothing to do.
        curvature = point.gauss_newton() if point.is_open and len(point.free) > 0 else None
        while curvature is not None and steps > 0 and slow < PATIENCE:
            if not point.is_open or out_of_time():
                break
            following = _line_search(point, curvature)
            if following is None:
                # Curvature from beyond a kink misleads.
                curvature = point.gauss_newton()
                following = _line_search(point, curvature)
            if following is None:
                break
            curvature = _update(curvature, point, following)
            slow = slow + 1 if following.merit > (1.0 - SLOW) * point.merit else 0
            point, steps = following, steps - 1
            on_step(point.candidate, point.merit)
        candidate = point.candidate
    return candidate


@dataclass(frozen=True)
class _Goal:
    """Objective and constraints of `improve`.

    Attributes
    ----------
    first: (n,) parameters of the die that is made better.
    """

    target: Floats
    maker: CandidateMaker
    preferences: Preferences
    sensitivity: TableSensitivity | None
    least_circle: float
    tolerance: float
    first: Floats

    @property
    def pull(self) -> float:
        """Derivative in each parameter of the residual that is its change."""
        return float(np.sqrt(self.preferences.nearness / len(self.first))) / FAR


@dataclass(frozen=True)
class _Point:
    """A die and how good it is."""

    goal: _Goal
    candidate: Candidate

    @cached_property
    def residuals(self) -> list[Tensor]:
        """Vectors whose squares are summed, but for `away`."""
        goal, rests, facets = self.goal, self.candidate.rests, self.candidate.outcome_facets
        die = OutcomeFacets(rests, facets, goal.sensitivity, self.candidate.model)
        parts = [
            *preference_residuals(die, goal.preferences),
            np.sqrt(goal.preferences.largest or 1.0) * barrier_residuals(rests),
        ]
        if goal.least_circle > 0.0:
            radii = circle_radii(rests, facets)
            parts.append(torch.relu(ROOM * goal.least_circle / radii - 1.0) / SHORTFALL)
        return parts

    @property
    def away(self) -> Floats:
        """(n,) residuals of parameters against those of the first die."""
        return self.goal.pull * (self.candidate.parameters - self.goal.first)

    @cached_property
    def _squares(self) -> Tensor:
        """() sum of the squares of `residuals`."""
        return torch.stack([vector @ vector for vector in self.residuals]).sum()

    @cached_property
    def merit(self) -> float:
        return self._squares.item() + float(self.away @ self.away)

    @property
    def is_short(self) -> bool:
        """True where a circle is too small."""
        least = self.goal.least_circle
        return least > 0.0 and self.candidate.least_circle < least

    @property
    def is_open(self) -> bool:
        """True where there is anything to make better."""
        return self.goal.preferences.largest > 0.0 or self.is_short

    @cached_property
    def _singular(self) -> tuple[Floats, Floats, Floats]:
        """Singular value decomposition of the probabilities' Jacobian (k, n): left vectors (k, r),
        values (r,), all right vectors (n, n)."""
        left, values, right = np.linalg.svd(self.candidate.probability_jacobian)
        rank = int((values > RANK).sum())
        return left[:, :rank], values[:rank], right

    @property
    def free(self) -> Floats:
        """(n - r, n) orthonormal directions that change no probabilities."""
        _, values, right = self._singular
        return right[len(values) :]

    def along(self, vector: Floats) -> Floats:
        """(n,) the part of a vector (n,) that changes no probabilities, to first order."""
        return self.free.T @ (self.free @ vector)

    @cached_property
    def gradient(self) -> Floats:
        """(n,) of the merit, along the manifold."""
        (gradient,) = self.candidate.jacobian(self._squares[None])
        return self.along(gradient + 2.0 * self.goal.pull * self.away)

    def gauss_newton(self) -> Floats:
        """(n, n) inverse of the damped Gauss-Newton matrix of the merit along the manifold; of more
        than `MOST_ROWS` residuals a multiple of the identity there, which costs no Jacobian."""
        free = self.free
        if sum(map(len, self.residuals)) > MOST_ROWS:
            steepness = max(float(np.linalg.norm(self.gradient)), np.finfo(np.float64).tiny)
            return free.T @ free * (LARGEST_MOVE / steepness)
        jacobian = self.candidate.jacobian(*self.residuals) @ free.T
        square = 2.0 * (jacobian.T @ jacobian + self.goal.pull**2 * np.eye(len(free)))
        damping = DAMPING * max(float(np.trace(square)), np.finfo(np.float64).tiny)
        return free.T @ np.linalg.solve(square + damping / len(free) * np.eye(len(free)), free)

    def move_along(self, move: Floats) -> _Point | None:
        """The point that a move (n,) along the tangent space and Newton's method back lead to, or
        None where no such die is found or a circle has become too small."""
        goal, before = self.goal, np.inf
        parameters, directions = self.candidate.parameters + move, self.candidate.directions
        for _ in range(MOST_CORRECTIONS + 1):
            candidate = goal.maker.attempt(self.candidate.coordinates, parameters, directions)
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
    """A point that is better by enough, in the direction of quasi-Newton."""
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
    """The inverse Hessian (n, n) by BFGS, with vectors projected into the new tangent space."""
    step = following.along(following.candidate.parameters - point.candidate.parameters)
    change = following.gradient - following.along(point.gradient)
    product = float(step @ change)
    if product <= CURVED * np.linalg.norm(step) * np.linalg.norm(change):
        return curvature
    keep = np.eye(len(step)) - np.outer(step, change) / product
    return keep @ curvature @ keep.T + np.outer(step, step) / product
