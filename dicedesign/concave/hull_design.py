"""Design of the hull of a surface for target probabilities, with a fixed center of mass.

The hull keeps its vertices, which move as smoothly and as little as the probabilities allow.
Gauss-Newton steps in the metric of `HullMetric` bring the probabilities of clusters of rests to the
target, while slopes (`SlopeMemory`) remove all rests but one of each outcome, which its direction
follows. Levenberg-Marquardt steps then meet the probabilities to rounding; `nearer_draft` reduces
the displacement of the surface.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from scipy.spatial import cKDTree

from dicedesign.concave.hull_problem import (
    DesignedHull,
    HeldCorners,
    HullMetric,
    HullProblem,
    spread_points,
)
from dicedesign.concave.result import shortfall
from dicedesign.concave.slopes import SlopeMemory, SlopeOptions, climbs, least_displacement
from dicedesign.errors import DiceError
from dicedesign.geometry.sphere import angle_between, foot_on_line, norms, unit_vectors
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates import Coordinates, VertexCoordinates
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.candidate import CandidateMaker, LevenbergMarquardt
from dicedesign.rest.outcomes import assign_rests
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE

MAX_GAIN = 0.05
"""Maximum change of a probability that one step aims at."""

EXACT = 1e-12
"""Largest |p - q| of an exact draft."""

SMOOTH = SobolevOptions(smoothing=5.0, power=2)
"""Metric of the steps to an exact draft."""


@dataclass(frozen=True)
class HullDraft:
    """Hull during its design.

    Attributes
    ----------
    corners: (n, 3) moved vertices of the original hull, with the center of mass at the origin.
    rests: rests of their hull.
    directions: (k, 3) directions of the outcomes.
    """

    corners: Floats
    rests: RestEvaluation
    directions: Floats

    @classmethod
    def of(cls, corners: Floats, directions: Floats) -> HullDraft | None:
        """Draft of a hull; None if there is no hull or the center of mass is outside."""
        try:
            rests = evaluate_rests(torch.from_numpy(corners), torch.zeros(3, dtype=torch.float64))
        except DiceError:
            return None
        is_finite = np.isfinite(rests.probability_values).all()
        return cls(corners, rests, directions) if is_finite else None

    @cached_property
    def rest_normals(self) -> Floats:
        """(r, 3) normals of all rests."""
        return self.rests.hull.normals[self.rests.paths.rests]

    @cached_property
    def main(self) -> Integers:
        """(k,) rest nearest to the direction of each outcome."""
        return np.argmax(self.directions @ self.rest_normals.T, axis=1)

    @cached_property
    def of_rest(self) -> Integers:
        """(r,) outcome of each rest: the one that takes the smallest climb to reach."""
        if self.alone:
            return np.argsort(self.main)
        climb = climbs(self.rests.hull.vertices, self.rest_normals, self.directions)
        of_rest = np.argmin(climb, axis=1)
        of_rest[self.main] = np.arange(len(self.main))
        return np.asarray(of_rest, dtype=np.int64)

    @property
    def alone(self) -> bool:
        """Whether each outcome has its own rest and there are no others."""
        return len(self.rests.probability_values) == len(self.main) == len(np.unique(self.main))

    @property
    def normals(self) -> Floats:
        """(k, 3) normals of the outcomes' main rests."""
        return self.rest_normals[self.main]

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) probabilities of the outcomes."""
        sums = np.bincount(self.of_rest, self.rests.probability_values, minlength=len(self.main))
        return np.asarray(sums, dtype=np.float64)

    @cached_property
    def apart(self) -> float:
        """Smallest angle between the main rests of two outcomes, in radians."""
        pairs = np.stack(np.triu_indices(len(self.main), 1))
        return float(angle_between(*self.normals[pairs]).min(initial=np.pi))

    @cached_property
    def margin(self) -> float:
        """Smallest angle by which the body must be tipped to leave an outcome, in radians."""
        paths, vertices = self.rests.paths, self.rests.hull.vertices
        tail, head = vertices[paths.saddle_ends.T]
        saddles = foot_on_line(tail, head, head - tail, np)
        first, second = self.of_rest[paths.basins.T]
        leaves = first != second
        angles = angle_between(self.rest_normals[paths.basins[leaves]], saddles[leaves, None])
        return float(angles.min(initial=np.pi))

    def error(self, target: Floats) -> float:
        """Largest |p - q|, or the probability of no outcome if that is larger."""
        outcomes = assign_rests(self.rest_normals, self.rests.probability_values, self.normals)
        return outcomes.error(target)

    def shortfall(self, problem: HullProblem) -> float:
        """Sum of the relative violations of all limits: of probabilities, angles and clearance; 0
        if they are met."""
        limits = [(self.apart, problem.apart), (self.margin, problem.margin)]
        if problem.clearance > 0.0:
            limits.append((self.clearance, problem.clearance))
        return shortfall(self.error(problem.target), problem.tolerance, *limits)

    @cached_property
    def clearance(self) -> float:
        """Smallest depth of the foot of the center of mass in an outcome's facet, or distance of it
        outside of a facet that is no rest and not near the main rest of an outcome, over the
        circumscribed radius; 0 if there are rests beside the main ones."""
        depths, normals, main = self.rests.depths, self.rests.hull.normals, self.normals
        if not self.alone:
            return 0.0
        aside = (normals @ main.T).max(axis=1) < math.cos(SAME_REST_ANGLE)
        rests = depths[self.rests.paths.rests]
        return max(0.0, float(np.concatenate([rests, -depths[aside]]).min()))

    @property
    def jacobian(self) -> Floats:
        """(k, n, 3) derivatives of the probabilities by the corners."""
        rests = self.rests
        sums = np.zeros((len(self.main), *self.corners.shape))
        by_corner = rests.jacobian.reshape(len(self.of_rest), -1, 3)
        for outcome in range(len(self.main)):
            sums[outcome, rests.hull.source] = by_corner[self.of_rest == outcome].sum(axis=0)
        return sums


def _least_work_step(
    problem: HullProblem,
    draft: HullDraft,
    compliance: Floats,
    memory: SlopeMemory,
    directions: Floats,
    step: int,
) -> Floats:
    """(n, 3) step of the corners toward the displacement of minimum work with the target."""
    displacement = draft.corners - problem.hull.vertices
    displacement = displacement + problem.shift(displacement)
    conditions = memory.conditions(draft.rests, directions, draft.of_rest, step)
    gains = np.clip(problem.target - draft.probabilities, -MAX_GAIN, MAX_GAIN)
    # The last equation follows from the others.
    following = least_displacement(
        compliance,
        displacement,
        conditions,
        conditions.excess(draft.corners),
        draft.jacobian[:-1],
        gains[:-1],
    )
    return following - displacement


def make_designed_hull(problem: HullProblem, draft: HullDraft) -> DesignedHull:
    """Place the hull of a draft as `HullProblem.designed`."""
    hull, moved = draft.rests.hull, draft.corners - problem.hull.vertices
    error = draft.error(problem.target)
    return problem.designed(hull.vertices, hull.source, moved, draft.normals, error)


class _AllCorners(VertexCoordinates):
    """Vertices that stay parameters when they leave the hull, as each is a point of the surface."""

    prune = Coordinates.prune


def exact_draft(problem: HullProblem, draft: HullDraft) -> HullDraft | None:
    """Move a draft without other rests to the target, to rounding; None if that fails."""
    if not draft.alone:
        return None
    maker = CandidateMaker(np.zeros(3))
    coordinates = _AllCorners(np.zeros(3), 1.0)
    first = maker.attempt(coordinates, draft.corners.ravel(), draft.normals)
    if first is None:
        return None
    trial = LevenbergMarquardt(problem.target, maker, EXACT / 2.0, SMOOTH).solve(first)
    if trial.error(problem.target) > EXACT:
        return None
    return HullDraft.of(trial.parameters.reshape(-1, 3), trial.directions)


STAGE_STEPS = 24
"""Number of steps in each metric."""

MAX_STEP = 0.03
"""Maximum move of a corner in one step, over the circumscribed radius."""

EXACT_FROM = 0.05
"""Largest |p - q| from which the exact draft is tried."""

METRICS = tuple(
    HullMetric(tether=0.2, smoothing=1.0, elastic=elastic, displaced=1.0)
    for elastic in (0.1, 0.03, 0.01)
)
"""Metrics of the steps, the stiffest first."""

FOLLOWED = 0.5
"""Share of the way to its main rest by which an outcome's direction moves in each step."""

MIN_FOLLOWED_COSINE = math.cos(math.radians(35.0))
"""Cosine of the largest angle to its main rest at which an outcome's direction follows it."""

EXTRA_APART = math.radians(5.0)
"""Angle beyond the required one that the directions of outcomes keep while they follow."""

HOPELESS_DISPLACEMENT = 0.3
"""Mean displacement of the corners, over the circumscribed radius, at which a design ends."""


def design_hull(
    problem: HullProblem,
    directions: Floats,
    slopes: SlopeOptions,
    on_step: Callable[[float, float], None],
) -> HullDraft | None:
    """Design a hull with the target probabilities and no other rests; if that fails, the draft with
    the smallest shortfall, or None if there was no hull.

    directions: (k, 3) unit directions of the outcomes, which may be no rests of the original;
    on_step: receives the energy and the largest |p - q| of every step.
    """
    memory, best = SlopeMemory(slopes), None
    corners, least = problem.hull.vertices, math.inf
    for step in range(STAGE_STEPS * len(METRICS)):
        draft = HullDraft.of(corners, directions)
        if draft is None:
            break
        error = draft.error(problem.target)
        on_step(float(((problem.target - draft.probabilities) ** 2).sum()), error)
        if draft.alone and error < EXACT_FROM:
            exact = exact_draft(problem, draft)
            if exact is not None and exact.shortfall(problem) == 0.0:
                return exact
        violation = draft.shortfall(problem)
        if violation == 0.0:
            return draft
        if violation < least:
            best, least = draft, violation
        # The directions follow their main rests as far as they stay apart.
        followed, normals = directions.copy(), draft.normals
        for number, main in enumerate(draft.main):
            is_shared = np.count_nonzero(draft.main == main) > 1
            if is_shared or normals[number] @ directions[number] < MIN_FOLLOWED_COSINE:
                continue
            nearer = (1.0 - FOLLOWED) * directions[number] + FOLLOWED * normals[number]
            nearer = unit_vectors(nearer)
            others = np.delete(followed, number, axis=0)
            if (others @ nearer).max(initial=-1.0) < math.cos(problem.apart + EXTRA_APART):
                followed[number] = nearer
        directions = followed
        compliance = problem.compliance(METRICS[step // STAGE_STEPS])
        change = _least_work_step(problem, draft, compliance, memory, directions, step)
        corners = corners + min(1.0, MAX_STEP / max(float(norms(change).max()), MAX_STEP)) * change
        if norms(corners - problem.hull.vertices).mean() > HOPELESS_DISPLACEMENT:
            break
    return best


HALVINGS = 3
"""Number of step lengths that are tried, each half of the one before."""

CORRECTIONS = 6
"""Maximum number of final Newton steps to the probabilities."""

MAX_GROUPS = 16
"""Maximum number of groups of corners that are eased in turn."""

NEAREST = HullMetric(tether=0.1, smoothing=0.2, elastic=0.01, displaced=1.0)
"""Metric that mainly reduces the displacement of the surface."""

UNCROSSED = HullMetric(tether=0.1, smoothing=0.3, elastic=1.0, displaced=0.1)
"""Metric that mainly reduces the elastic work, for surfaces that would intersect themselves."""


def _move(
    problem: HullProblem, draft: HullDraft, change: Floats, violation: float
) -> HullDraft | None:
    """Move the corners by the first of a change (n, 3), its half and so on that keeps the shortfall
    at most at `violation`; None if none does."""
    for halving in range(HALVINGS):
        following = HullDraft.of(draft.corners + 0.5**halving * change, draft.normals)
        if (
            following is not None
            # Decides most cases without the angles.
            and following.error(problem.target) <= (1.0 + violation) * problem.tolerance
            and following.shortfall(problem) <= violation
        ):
            return following
    return None


def settle_draft(problem: HullProblem, draft: HullDraft) -> HullDraft:
    """Reduce the error of the probabilities of a draft as far as possible."""
    exact = exact_draft(problem, draft)
    if exact is not None:
        return exact
    compliance = problem.compliance(NEAREST)
    for _ in range(CORRECTIONS):
        # The last equation follows from the others.
        jacobian = draft.jacobian[:-1]
        raised = np.tensordot(jacobian, compliance, 2)
        square = np.tensordot(jacobian, raised, ((1, 2), (1, 2)))
        misses = (problem.target - draft.probabilities)[:-1]
        step = np.tensordot(np.linalg.lstsq(square, misses)[0], raised, 1)
        following = HullDraft.of(draft.corners + step, draft.normals)
        if following is None or not following.error(problem.target) < draft.error(problem.target):
            break
        draft = following
    return draft


def relax_hull(
    problem: HullProblem, design: DesignedHull, places: Floats, width: float
) -> DesignedHull | None:
    """Move corners of a design near given places to where the other corners would take them, as far
    as the shortfall does not grow; None if no corner moves.

    places: (p, 3) points of the original surface; width: largest distance of the corners from them,
    over the circumscribed radius.
    """
    original = problem.hull.vertices
    near = np.flatnonzero(cKDTree(places).query(original)[0] < width)
    draft = HullDraft.of(original + design.moved, design.directions)
    if draft is None or len(near) == 0:
        return None
    violation = draft.shortfall(problem)
    middles = original[near][spread_points(original[near], MAX_GROUPS)]
    distance, owner = cKDTree(middles).query(original)
    # Corners of the surface if it is not bent.
    unbent, is_eased = original - design.shift, False
    for place in range(len(middles)):
        is_free = (owner == place) & (distance < width)
        held = HeldCorners(problem.elasticity, problem.source[~is_free])
        followed = held.follow((draft.corners - unbent)[~is_free])
        goal = draft.corners.copy()
        goal[is_free] = unbent[is_free] + followed[problem.source[is_free]]
        following = _move(problem, draft, goal - draft.corners, violation)
        if following is not None:
            draft, is_eased = following, True
    return make_designed_hull(problem, settle_draft(problem, draft)) if is_eased else None
