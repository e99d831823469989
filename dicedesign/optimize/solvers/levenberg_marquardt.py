"""Levenberg-Marquardt steps from a die to wanted odds.

A die has several parameters for each outcome, so the equations p = q have many solutions, and the
shortest step to one is taken: `-W^-1 J^T (J W^-1 J^T + mu I)^-1 r` in a metric W. Probabilities
jump where a facet gains or loses stability, so depths of facets near that edge are residuals too,
which fade out at the end, and a step that changes which facets are rests is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker
from dicedesign.optimize.solvers.sobolev import SobolevSolver, graph_laplacian
from dicedesign.runtime.arrays import Floats, Integers

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
    """Steps from a die towards odds.

    Attributes
    ----------
    target: (k,) the odds.
    maker: makes the dice that are tried.
    sobolev: the metric `(I + lambda L)^p` in which steps of vertices are shortest, or None for
        lengths as they are.
    tolerance: largest |p - q| wanted.
    out_of_time: asked before every step.
    on_candidate: called with the first die and every one that a step leads to.
    least_angle: between the facets of two outcomes, in radians; what lies nearer is a residual too
        until the end. 0 for none.
    """

    target: Floats
    maker: CandidateMaker
    sobolev: SobolevOptions | None
    tolerance: float
    out_of_time: Callable[[], bool]
    on_candidate: Callable[[Candidate], None]
    least_angle: float = 0.0

    def solve(self, first: Candidate) -> Candidate:
        """The die where the steps end, within the tolerance or not."""
        current = first
        self.on_candidate(current)
        near = current.error(self.target) < NEAR
        weights = iter((0.0, *WALL_WEIGHTS) if near else WALL_WEIGHTS)
        weight, damping = next(weights), DAMPINGS[1]
        for _ in range(MOST_STEPS):
            if current.error(self.target) <= self.tolerance or self.out_of_time():
                break
            following, damping = self._step(current, weight, damping)
            before = self._merit(current, weight)
            if following is not None:
                gained = 1.0 - self._merit(following, weight) / before
                current = self._pruned(following)
                self.on_candidate(current)
                if gained >= SLOW:
                    continue
            following_weight = next(weights, None)
            if following_weight is None:
                break
            weight, damping = following_weight, DAMPINGS[1]
        return current

    def _step(
        self, current: Candidate, weight: float, damping: float
    ) -> tuple[Candidate | None, float]:
        """An acceptable candidate, or None, and the damping for the next step."""
        residuals, jacobian = self._residuals(current, weight), self._jacobian(current, weight)
        raised = self._raised(current, jacobian)
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
            if candidate is not None and self._merit(candidate, weight) < merit:
                return candidate, max(0.1 * damping, DAMPINGS[0])
            damping = max(10.0 * damping, LEAST_REFUSED)
        return None, damping

    def _raised(self, current: Candidate, jacobian: Floats) -> Floats:
        """(n, r) columns W^-1 J^T for the Jacobian (r, n)."""
        if self.sobolev is None:
            return jacobian.T
        hull = current.rests.hull
        columns = jacobian.T.reshape(-1, 3 * len(jacobian))
        smooth = np.zeros_like(columns)
        solver = SobolevSolver(graph_laplacian(hull), self.sobolev)
        smooth[hull.source] = solver.solve(columns[hull.source])
        return smooth.reshape(jacobian.T.shape)

    def _residuals(self, candidate: Candidate, weight: float) -> Floats:
        """(r,) p - q, and with a weight above 0 what facets near the edge lack in depth, and
        outcomes near each other in distance."""
        misses = candidate.odds - self.target
        if weight == 0.0:
            return misses
        depths = candidate.signed_depths.detach().numpy()
        lacking = 1.0 - depths[depths < DEPTH_MARGIN] / DEPTH_MARGIN
        first, second = candidate.directions[self._crowded(candidate)]
        crowding = ((first * second).sum(1) - np.cos(self.least_angle)) / self._falling
        return np.concatenate([misses, weight * lacking, weight * crowding])

    def _jacobian(self, candidate: Candidate, weight: float) -> Floats:
        """(r, n) of the residuals."""
        if weight == 0.0:
            return candidate.odds_jacobian
        near = candidate.signed_depths[candidate.signed_depths.detach() < DEPTH_MARGIN]
        values = [-weight / DEPTH_MARGIN * near]
        crowded = self._crowded(candidate)
        if crowded.size > 0:
            normals = candidate.rests.facet_normals(candidate.outcome_facets)
            cosines = (normals[crowded[0]] * normals[crowded[1]]).sum(1)
            values.append(weight / self._falling * cosines)
        return np.concatenate([candidate.odds_jacobian, candidate.jacobian(*values)])

    def _crowded(self, candidate: Candidate) -> Integers:
        """(2, c) pairs of outcomes that are nearer than the least angle."""
        if self.least_angle == 0.0:
            return np.zeros((2, 0), dtype=np.int64)
        cosines = np.triu(candidate.directions @ candidate.directions.T, 1)
        return np.stack(np.nonzero(cosines > 1.0 - self._falling))

    @property
    def _falling(self) -> float:
        """By how much the cosine of a pair, whose residual falls from 1 to 0, falls from angle 0 to
        the least one; above 0."""
        return max(1.0 - float(np.cos(self.least_angle)), SAME)

    def _merit(self, candidate: Candidate, weight: float) -> float:
        return float((self._residuals(candidate, weight) ** 2).sum())

    def _attempt(self, current: Candidate, parameters: Floats) -> Candidate | None:
        return self.maker.attempt(current.coordinates, parameters, current.directions)

    def _pruned(self, candidate: Candidate) -> Candidate:
        """The candidate without the parameters that its shape no longer uses."""
        pruned = candidate.coordinates.pruned(candidate.parameters, candidate.rests)
        if len(pruned) == len(candidate.parameters):
            return candidate
        return self._attempt(candidate, pruned) or candidate
