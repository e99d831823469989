"""Designing the hull of a surface for wanted probabilities, its center of mass held where it is.

The hull stays dense: its corners are moved as smoothly and as little as the probabilities allow.
All rests but the wanted ones are made to drain (`SlopeMemory`) while the probabilities of their
clusters go to the target, by Gauss-Newton steps in the metric of `HullMetric`; the outcomes'
directions follow their own rests on the way. From there Levenberg-Marquardt steps meet the
probabilities to rounding. Then the hull is brought to take the surface less work."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

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
from dicedesign.optimize.coordinates import VertexCoordinates
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.candidate import CandidateMaker, LevenbergMarquardt
from dicedesign.rest.outcomes import assign_rests
from dicedesign.runtime.arrays import Floats, Integers

LARGEST_GAIN = 0.05
"""Most by which probabilities are to change in one step."""

EXACT = 1e-12
"""Largest |p - q| of an exact draft."""

SMOOTH = SobolevOptions(smoothing=5.0, power=2)
"""Metric of the steps to it."""


@dataclass(frozen=True)
class HullDraft:
    """A hull on the way.

    Attributes
    ----------
    corners: (n, 3) those of the original hull, moved; the center of mass is the origin.
    rests: of their hull.
    directions: (k, 3) of the outcomes.
    """

    corners: Floats
    rests: RestEvaluation
    directions: Floats

    @classmethod
    def of(cls, corners: Floats, directions: Floats) -> HullDraft | None:
        """Draft of a hull; None if the center of mass is outside or there is no hull."""
        try:
            rests = evaluate_rests(torch.from_numpy(corners), torch.zeros(3, dtype=torch.float64))
            draft = cls(corners, rests, directions)
            return draft if np.isfinite(rests.probability_values).all() else None
        except DiceError:
            return None

    @cached_property
    def rest_normals(self) -> Floats:
        """(r, 3) of all rests."""
        return self.rests.hull.normals[self.rests.paths.rests]

    @cached_property
    def main(self) -> Integers:
        """(k,) the rest nearest to each outcome's direction."""
        return np.argmax(self.directions @ self.rest_normals.T, axis=1)

    @cached_property
    def of_rest(self) -> Integers:
        """(r,) outcome of each rest: the one with the least to climb on the way."""
        if self.alone:
            return np.argsort(self.main)
        climb = climbs(self.rests.hull.vertices, self.rest_normals, self.directions)
        of_rest = np.argmin(climb, axis=1)
        of_rest[self.main] = np.arange(len(self.main))
        return np.asarray(of_rest, dtype=np.int64)

    @property
    def alone(self) -> bool:
        """True if each outcome has a rest of its own and there is no other."""
        return len(self.rests.probability_values) == len(self.main) == len(np.unique(self.main))

    @property
    def normals(self) -> Floats:
        """(k, 3) normals of the outcomes' own rests."""
        return self.rest_normals[self.main]

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) of the outcomes."""
        sums = np.bincount(self.of_rest, self.rests.probability_values, minlength=len(self.main))
        return np.asarray(sums, dtype=np.float64)

    @cached_property
    def apart(self) -> float:
        """Least angle between two outcomes' own rests, in radians."""
        one, other = np.triu_indices(len(self.main), 1)
        angles = angle_between(self.normals[one], self.normals[other])
        return float(angles.min(initial=np.pi))

    @cached_property
    def margin(self) -> float:
        """Least angle, in radians, by which the body must be tipped to leave an outcome."""
        paths, vertices = self.rests.paths, self.rests.hull.vertices
        tail, head = vertices[paths.saddle_ends[:, 0]], vertices[paths.saddle_ends[:, 1]]
        saddles = foot_on_line(tail, head, head - tail, np)
        outcomes = self.of_rest[paths.basins]
        leaves = outcomes[:, 0] != outcomes[:, 1]
        angles = angle_between(self.rest_normals[paths.basins[leaves]], saddles[leaves, None])
        return float(angles.min(initial=np.pi))

    def error(self, target: Floats) -> float:
        """Largest error of the outcomes' probabilities, or the probability elsewhere if larger."""
        return assign_rests(self.rest_normals, self.rests.probability_values, self.normals).error(
            target
        )

    def lacks_at_most(self, problem: HullProblem, missing: float) -> bool:
        """Whether the shortfall is no more than so much, which the probabilities alone often
        tell."""
        error = self.error(problem.target)
        if error > (1.0 + missing) * problem.tolerance:
            return False
        return self.shortfall(problem) <= missing

    def shortfall(self, problem: HullProblem) -> float:
        """Sum of the relative distances of probabilities, angles and margins from their limits; 0
        if all are met."""
        apart, margin = (self.apart, problem.apart), (self.margin, problem.margin)
        return shortfall(self.error(problem.target), problem.tolerance, apart, margin)

    @property
    def jacobian(self) -> Floats:
        """(k, n, 3) of the probabilities in the corners."""
        rests = self.rests
        sums = np.zeros((len(self.main), *self.corners.shape))
        by_corner = rests.jacobian.reshape(len(self.of_rest), -1, 3)
        for outcome in range(len(self.main)):
            mine = self.of_rest == outcome
            sums[outcome, rests.hull.source] = by_corner[mine].sum(axis=0)
        return sums


def change_of_least_work(
    problem: HullProblem,
    draft: HullDraft,
    compliance: Floats,
    memory: SlopeMemory,
    directions: Floats,
    step: int,
) -> Floats:
    """(n, 3) from a draft to the displacement of least work with the target's probabilities."""
    displacement = draft.corners - problem.hull.vertices
    displacement = displacement + problem.shift(displacement)
    conditions = memory.conditions(draft.rests, directions, draft.of_rest, step)
    gains = np.clip(problem.target - draft.probabilities, -LARGEST_GAIN, LARGEST_GAIN)
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


def make_designed_hull(problem: HullProblem, draft: HullDraft) -> DesignedHull:
    """A draft as the hull to fill, where the surface would be led by its corners alone."""
    own, moved = draft.rests.hull, draft.corners - problem.hull.vertices
    error = draft.error(problem.target)
    return problem.designed(own.vertices, own.source, moved, draft.normals, error)


class _AllCorners(VertexCoordinates):
    """Corners that leave the hull stay parameters: each is a point of the surface."""

    def prune(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        return parameters


def exact_draft(problem: HullProblem, draft: HullDraft) -> HullDraft | None:
    """The hull with the probabilities of the target to rounding to which steps lead from a draft
    with no rests but the wanted ones; None where they lead to none."""
    if not draft.alone:
        return None
    maker = CandidateMaker(np.zeros(3))
    coordinates = _AllCorners(np.zeros(3), 1.0)
    first = maker.attempt(coordinates, draft.corners.ravel(), draft.normals)
    if first is None:
        return None
    steps = LevenbergMarquardt(problem.target, maker, EXACT / 2.0, SMOOTH)
    trial = steps.solve(first)
    if trial.error(problem.target) > EXACT:
        return None
    return HullDraft.of(trial.parameters.reshape(-1, 3), trial.directions)


STAGE_STEPS = 24
"""Steps in each of the metrics, one after the other."""

LARGEST_STEP = 0.03
"""Farthest that a corner moves in one of them, over the circumscribed radius."""

NEAR = 0.05
"""Largest |p - q| from which on the last steps go."""

SOFTENING = tuple(
    HullMetric(tether=0.2, smoothing=1.0, elastic=elastic, displaced=1.0)
    for elastic in (0.1, 0.03, 0.01)
)
"""Metrics of the steps: the stiffest in which a hull comes about is kept."""

FOLLOWED = 0.5
"""Part of the way to its own rest that an outcome's direction goes in each step."""

FOLLOWING = math.cos(math.radians(35.0))
"""Cosine of the angle beyond which it does not."""

ROOM = math.radians(5.0)
"""Angle beyond the least one between outcomes that their directions keep."""

HOPELESS = 0.3
"""Mean displacement of the corners, over the circumscribed radius, at which nothing is hoped for
any more."""


def design_hull(
    problem: HullProblem,
    directions: Floats,
    slopes: SlopeOptions,
    on_step: Callable[[float, float], None],
) -> HullDraft | None:
    """A hull with the wanted probabilities and no other rests; where this way leads to none, the
    one on it that was off by least, or None where there was no hull at all.

    directions: (k, 3) unit directions of the outcomes, of rests of the original or not; on_step:
    called with the energy and the largest |p - q| of every step.
    """
    memory, best = SlopeMemory(slopes), None
    corners, least = problem.hull.vertices, math.inf
    for step in range(STAGE_STEPS * len(SOFTENING)):
        draft = HullDraft.of(corners, directions)
        if draft is None:
            break
        error = draft.error(problem.target)
        on_step(float(((problem.target - draft.probabilities) ** 2).sum()), error)
        if draft.alone and error < NEAR:
            exact = exact_draft(problem, draft)
            if exact is not None and exact.shortfall(problem) == 0.0:
                return exact
        missing = draft.shortfall(problem)
        if missing == 0.0:
            return draft
        if missing < least:
            best, least = draft, missing
        directions = _follow_rests(problem, draft, directions)
        compliance = problem.compliance(SOFTENING[step // STAGE_STEPS])
        change = change_of_least_work(problem, draft, compliance, memory, directions, step)
        longest = float(norms(change).max())
        corners = corners + min(1.0, LARGEST_STEP / max(longest, LARGEST_STEP)) * change
        if norms(corners - problem.hull.vertices).mean() > HOPELESS:
            break
    return best


def _follow_rests(problem: HullProblem, draft: HullDraft, directions: Floats) -> Floats:
    """The outcomes' directions (k, 3) on the way to their own rests, as far as they stay apart."""
    followed = directions.copy()
    normals = draft.normals
    for number, main in enumerate(draft.main):
        alone = np.count_nonzero(draft.main == main) == 1
        if not alone or normals[number] @ directions[number] < FOLLOWING:
            continue
        nearer = unit_vectors((1.0 - FOLLOWED) * directions[number] + FOLLOWED * normals[number])
        others = np.delete(followed, number, axis=0)
        if (others @ nearer).max(initial=-1.0) < math.cos(problem.apart + ROOM):
            followed[number] = nearer
    return followed


ROUNDS = 5
"""Most rounds back toward the original."""

WORTH = 0.98
"""Part of the displacement that may be left by a round with another after it."""

SWEEPS = 4
"""Sweeps over the hull in each."""

PLACES = 40
"""Places in each sweep, spread over the hull."""

PLACE_WIDTH = 1.0
"""Width of a place, times the root of their number, over the circumscribed radius."""

HALVINGS = 3
"""Tries of half the length each."""

CORRECTIONS = 6
"""Newton steps to the probabilities, at the end."""

EASED = 16
"""Most groups of corners that are eased at a time."""

NEAREST = HullMetric(tether=0.1, smoothing=0.2, elastic=0.01, displaced=1.0)
"""Metric of the steps: the displacement of the surface, above all."""

UNCROSSED = HullMetric(tether=0.1, smoothing=0.3, elastic=1.0, displaced=0.1)
"""Metric where the surface meets itself: the work that it takes, above all."""


def nearer_draft(
    problem: HullProblem,
    draft: HullDraft,
    slopes: SlopeOptions,
    metric: HullMetric = NEAREST,
) -> HullDraft:
    """A hull that is as good and nearer to the original: steps to the least displacement among
    hulls with these probabilities, of all corners and then of those about one place after the
    other. Each goes as far as it makes nothing worse that will do."""
    compliance, original = problem.compliance(metric), problem.hull.vertices
    centers = original[spread_points(original, PLACES)]
    widths = PLACE_WIDTH / np.sqrt(len(centers))
    squares = cdist(centers, original, "sqeuclidean")
    about = np.exp(-squares / (2.0 * widths**2))[:, :, None]
    for _ in range(ROUNDS):
        nearer, memory, missing = draft, SlopeMemory(slopes), draft.shortfall(problem)
        for sweep in range(SWEEPS):
            first = nearer
            goal = nearer.corners + change_of_least_work(
                problem, nearer, compliance, memory, nearer.normals, sweep
            )
            for part in (np.ones((1, 1)), *about):
                change = part * (goal - nearer.corners)
                nearer = _move(problem, nearer, change, missing) or nearer
            if nearer is first:
                break
        before, after = (problem.displacement(hull.corners - original) for hull in (draft, nearer))
        if after < before:
            draft = nearer
        if after >= WORTH * before:
            break
    return draft


def _move(
    problem: HullProblem, draft: HullDraft, change: Floats, missing: float
) -> HullDraft | None:
    """A draft after a change (n, 3) of its corners, or the first half, ... of it, from which no
    more is missing than so much; None where more is all the way."""
    for halving in range(HALVINGS):
        following = HullDraft.of(draft.corners + 0.5**halving * change, draft.normals)
        if following is not None and following.lacks_at_most(problem, missing):
            return following
    return None


def settle_draft(problem: HullProblem, draft: HullDraft) -> HullDraft:
    """The hull whose probabilities are met as well as can be, next to one where they nearly are."""
    exact = exact_draft(problem, draft)
    if exact is not None:
        return exact
    compliance = problem.compliance(NEAREST)
    for _ in range(CORRECTIONS):
        # The last of the equations follows from the others.
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
    """A design whose corners near some places (p, 3) of the original surface go where the others
    would take them, as far as that makes nothing worse that will do; None where it does at once.

    width: distance from a place within which corners are eased, over the circumscribed radius.
    """
    original = problem.hull.vertices
    near = np.flatnonzero(cKDTree(places).query(original)[0] < width)
    draft = HullDraft.of(original + design.moved, design.directions)
    if draft is None or len(near) == 0:
        return None
    missing = draft.shortfall(problem)
    middles = original[near][spread_points(original[near], EASED)]
    owner = cKDTree(middles).query(original)
    # Where the corners are when the surface is not bent.
    unbent, eased = original - design.shift, False
    for place in range(len(middles)):
        group = np.flatnonzero((owner[1] == place) & (owner[0] < width))
        others = np.setdiff1d(np.arange(len(original)), group)
        held = HeldCorners(problem.elasticity, problem.source[others])
        followed = held.follow((draft.corners - unbent)[others])
        goal = draft.corners.copy()
        goal[group] = unbent[group] + followed[problem.source[group]]
        following = _move(problem, draft, goal - draft.corners, missing)
        if following is not None:
            draft, eased = following, True
    if not eased:
        return None
    return make_designed_hull(problem, settle_draft(problem, draft))
