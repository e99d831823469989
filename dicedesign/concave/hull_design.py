"""Designing the hull of a surface for wanted odds, its center of mass held where it is.

The hull stays dense: its corners are moved as smoothly and as little as the odds allow. First all
rests but the wanted ones are made to drain (`SlopeMemory`) while the odds of their clusters go to
the target, by Gauss-Newton steps in the metric of `HullMetric`; from there Levenberg-Marquardt
steps meet the odds to rounding; then the hull goes back toward the original as far as it can.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from dicedesign.concave.elasticity import Elasticity, HeldCorners
from dicedesign.concave.hull_step import least_displacement
from dicedesign.concave.slopes import SlopeMemory, SlopeOptions, climbs
from dicedesign.concave.surface import Surface
from dicedesign.design.coordinates import VertexCoordinates
from dicedesign.design.differentiable import RestEvaluation, evaluate_rests
from dicedesign.design.levenberg_marquardt import Approach
from dicedesign.design.sobolev import SobolevOptions, graph_laplacian
from dicedesign.design.trial import TrialMaker
from dicedesign.errors import DiceError
from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = ["DesignedHull", "HullMetric", "HullProblem", "design_hull"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

STAGE_STEPS: Final = 12
"""Steps in each of the metrics, one after the other."""

LARGEST_STEP: Final = 0.03
"""Farthest that a corner moves in one of them, over the circumscribed radius."""

LARGEST_GAIN: Final = 0.05
"""Most by which odds are to change in one of them."""

NEAR: Final = 0.03
"""Largest |p - q| from which on the last steps go."""

EXACT: Final = 1e-12
"""Largest |p - q| with which they end."""

SMOOTH: Final = SobolevOptions(smoothing=5.0, power=2)
"""Metric of the last steps."""

MOST_RETURNS: Final = 40
"""Steps back toward the original, at the end."""

SHORTEST_RETURN: Final = 0.005
"""Part of the way to the least work below which none is taken."""


@dataclass(frozen=True)
class HullMetric:
    """What displacements of corners cost: `|(tether I + smoothing L) u|^2 / n`, with the graph
    Laplacian L of the original hull (the Sobolev metric of section 3.3), and `elastic` times the
    work that the surface takes.

    Attributes
    ----------
    tether, smoothing: positive.
    elastic: not negative.
    """

    tether: float
    smoothing: float
    elastic: float


SOFTENING: Final = tuple(
    HullMetric(tether=0.5, smoothing=5.0, elastic=elastic)
    for elastic in (1.0, 0.3, 0.1, 0.03, 0.01, 0.003)
)
"""Metrics of the first steps: the stiffest in which a hull comes about is kept."""

RETURNING: Final = HullMetric(tether=0.1, smoothing=0.3, elastic=1.0)
"""Metric of those steps: the work that the surface takes, above all."""


@dataclass(frozen=True)
class HullProblem:
    """A surface whose hull is to have wanted odds.

    Attributes
    ----------
    surface: its center of mass at the origin, its circumscribed radius 1.
    target: (k,) the odds.
    tolerance: largest error (`DesignedHull.error`) that will do.
    """

    surface: Surface
    target: Floats
    tolerance: float

    @cached_property
    def hull(self) -> ConvexHull:
        """Of the surface as it is."""
        return convex_hull(self.surface.points)

    @cached_property
    def _laplacian(self) -> Floats:
        return np.asarray(graph_laplacian(self.hull).toarray(), dtype=np.float64)

    @cached_property
    def elasticity(self) -> Elasticity:
        """Of the surface."""
        return Elasticity(self.surface)

    @cached_property
    def relative(self) -> tuple[Floats, Floats]:
        """See `HeldCorners.relative`, for the corners of the hull."""
        return HeldCorners(self.elasticity, self.hull.source).relative

    @cached_property
    def _compliances(self) -> dict[HullMetric, Floats]:
        return {}

    def compliance(self, metric: HullMetric) -> Floats:
        """(n, 3, n, 3) displacement of the hull's corners for forces on them."""
        if metric not in self._compliances:
            self._compliances[metric] = self._compliance(metric)
        return self._compliances[metric]

    def _compliance(self, metric: HullMetric) -> Floats:
        count = len(self.hull.vertices)
        root = metric.tether * np.eye(count) + metric.smoothing * self._laplacian
        smooth = root @ root / count
        stiffness = metric.elastic * self.relative[0]
        for axis in range(3):
            stiffness[:, axis, :, axis] += smooth
        flat = stiffness.reshape(3 * count, 3 * count)
        return np.linalg.inv(flat).reshape(count, 3, count, 3)


@dataclass(frozen=True)
class DesignedHull:
    """A hull with the wanted odds.

    Attributes
    ----------
    hull: in the place of the surface; its corners are those of the surface's hull, moved, or some
        of them.
    corners: (v,) number of the surface's point of each corner.
    center_of_mass: (3,) for which its odds are the wanted ones.
    directions: (k, 3) normals of the outcomes' rests.
    error: largest of |p - q| over clusters of rests within `SAME_REST_ANGLE` of those, and the odds
        of all other rests together.
    """

    hull: ConvexHull
    corners: Integers
    center_of_mass: Floats
    directions: Floats
    error: float


def design_hull(
    problem: HullProblem,
    directions: Floats,
    slopes: SlopeOptions,
    on_step: Callable[[float, float], None],
) -> DesignedHull | None:
    """A hull with the wanted odds and no other rests, or None where this way leads to none.

    directions: (k, 3) unit directions of the outcomes, of rests of the original or not; on_step:
    called with the energy and the largest |p - q| of every step.
    """
    drained = _drained(problem, directions, slopes, on_step)
    if drained is None:
        return None
    best = _nearer(problem, drained, slopes)
    best = _exact(problem, best) or best
    moved = best.corners - problem.hull.vertices
    error = best.error(problem.target)
    on_step(float((moved**2).sum()), error)
    center = np.tensordot(moved, problem.relative[1], 2)
    own = best.rests.hull
    hull = convex_hull(own.vertices + center)
    corners = problem.hull.source[own.source[hull.source]]
    return DesignedHull(hull, corners, center, best.normals, error)


def _drained(
    problem: HullProblem,
    directions: Floats,
    slopes: SlopeOptions,
    on_step: Callable[[float, float], None],
) -> _Draft | None:
    """A hull near the original that leaves little but the wanted rests, with odds near enough to
    the target; None where it does not come about."""
    memory = SlopeMemory(slopes)
    corners = problem.hull.vertices
    for step in range(STAGE_STEPS * len(SOFTENING)):
        draft = _Draft.of(corners, directions)
        if draft is None:
            return None
        error = draft.error(problem.target)
        on_step(float(((problem.target - draft.odds) ** 2).sum()), error)
        if error <= problem.tolerance:
            return draft
        if draft.alone and error < NEAR:
            exact = _exact(problem, draft)
            if exact is not None:
                return exact
        compliance = problem.compliance(SOFTENING[step // STAGE_STEPS])
        change = _change(problem, draft, compliance, memory, directions, step)
        longest = float(norms(change).max())
        corners = corners + min(1.0, LARGEST_STEP / max(longest, LARGEST_STEP)) * change
    return None


def _change(
    problem: HullProblem,
    draft: _Draft,
    compliance: Floats,
    memory: SlopeMemory,
    directions: Floats,
    step: int,
) -> Floats:
    """(n, 3) from a draft to the displacement of least work with the target's odds."""
    displacement = draft.corners - problem.hull.vertices
    conditions = memory.conditions(draft.rests, directions, draft.of_rest, step)
    gains = np.clip(problem.target - draft.odds, -LARGEST_GAIN, LARGEST_GAIN)
    # The last of the equations follows from the others.
    following = least_displacement(
        compliance,
        displacement,
        conditions,
        conditions.excess(draft.corners),
        draft.jacobian[:-1],
        gains[:-1],
    )
    return following - displacement


def _nearer(problem: HullProblem, draft: _Draft, slopes: SlopeOptions) -> _Draft:
    """A hull that is as good and takes less work: steps to the least work among hulls with these
    odds, shorter ones after each that would lead to a worse hull."""
    compliance, memory = problem.compliance(RETURNING), SlopeMemory(slopes)
    reach = LARGEST_STEP
    for step in range(MOST_RETURNS):
        change = _change(problem, draft, compliance, memory, draft.normals, step)
        longest = float(norms(change).max())
        following = None
        while following is None and reach > SHORTEST_RETURN * longest:
            tried = draft.corners + min(1.0, reach / longest) * change
            found = _Draft.of(tried, draft.normals)
            if found is not None:
                if found.error(problem.target) <= problem.tolerance:
                    following = found
                    break
                memory.conditions(found.rests, draft.normals, found.of_rest, step)
            reach *= 0.5
        if following is None:
            break
        draft, reach = following, min(2.0 * reach, LARGEST_STEP)
    return draft


@dataclass(frozen=True)
class _Draft:
    """A hull on the way.

    Attributes
    ----------
    corners: (n, 3) those of the original hull, moved; the center of mass is the origin.
    rests: of their hull.
    main: (k,) the rest nearest to each outcome's direction.
    of_rest: (r,) outcome of each rest: the one with the least to climb on the way.
    """

    corners: Floats
    rests: RestEvaluation
    main: Integers
    of_rest: Integers

    @classmethod
    def of(cls, corners: Floats, directions: Floats) -> _Draft | None:
        """None where the center of mass is outside, or the hull is none."""
        try:
            rests = evaluate_rests(torch.from_numpy(corners), torch.zeros(3, dtype=torch.float64))
            normals = rests.hull.normals[rests.paths.rests]
            main = np.argmax(directions @ normals.T, axis=1)
            of_rest = np.argmin(climbs(rests.hull.vertices, normals, directions), axis=1)
            of_rest[main] = np.arange(len(directions))
            draft = cls(corners, rests, main, of_rest)
            return draft if np.isfinite(draft.odds).all() else None
        except DiceError:
            return None

    @property
    def alone(self) -> bool:
        """Whether each outcome has a rest of its own and there is no other."""
        return len(self.of_rest) == len(self.main) == len(np.unique(self.main))

    @property
    def normals(self) -> Floats:
        """(k, 3) those of the outcomes' own rests."""
        return self.rests.hull.normals[self.rests.paths.rests[self.main]]

    @cached_property
    def odds(self) -> Floats:
        """(k,) of the outcomes."""
        return np.bincount(self.of_rest, self.rests.odds, minlength=len(self.main))

    def error(self, target: Floats) -> float:
        """See `DesignedHull.error`."""
        rests = self.rests.hull.normals[self.rests.paths.rests]
        cosines = rests @ self.normals.T
        near = cosines.max(axis=1) >= np.cos(SAME_REST_ANGLE)
        nearest = cosines.argmax(axis=1)
        odds = np.bincount(nearest[near], self.rests.odds[near], minlength=len(target))
        elsewhere = float(self.rests.odds[~near].sum())
        return max(float(np.abs(odds - target).max()), elsewhere)

    @property
    def jacobian(self) -> Floats:
        """(k, n, 3) of the odds in the corners."""
        rests = self.rests
        of_rests = rests.jacobian
        if of_rests is None:
            leaf = rests.vertices.detach().requires_grad_()
            moving = replace(rests, vertices=leaf)
            rows = [
                torch.autograd.grad(odds, leaf, retain_graph=True)[0].numpy()
                for odds in moving.probabilities
            ]
            of_rests = np.stack(rows)
        sums = np.zeros((len(self.main), *self.corners.shape))
        by_corner = of_rests.reshape(len(self.of_rest), -1, 3)
        for outcome in range(len(self.main)):
            mine = self.of_rest == outcome
            sums[outcome, rests.hull.source] = by_corner[mine].sum(axis=0)
        return sums


class _AllCorners(VertexCoordinates):
    """Corners that leave the hull stay parameters: each is a point of the surface."""

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        return parameters


def _exact(problem: HullProblem, draft: _Draft) -> _Draft | None:
    """The hull with the odds of the target to rounding to which steps lead from a draft with no
    rests but the wanted ones; None where they lead to none."""
    if not draft.alone:
        return None
    maker = TrialMaker(np.zeros(3))
    coordinates = _AllCorners(np.zeros(3), 1.0)
    first = maker.attempt(coordinates, draft.corners.ravel(), draft.normals)
    if first is None:
        return None
    steps = Approach(problem.target, maker, SMOOTH, EXACT / 2.0, lambda: False, lambda trial: None)
    trial = steps.end(first)
    if trial.error(problem.target) > EXACT:
        return None
    return _Draft.of(trial.parameters.reshape(-1, 3), trial.directions)
