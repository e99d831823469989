"""Hull of a surface during its design for target probabilities: its rests, its limits, and the last
steps to the exact probabilities, with a fixed center of mass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from scipy.spatial import cKDTree

from dicedesign.concave.hull_problem import (
    NEAREST,
    DesignedHull,
    HeldCorners,
    HullProblem,
    spread_points,
)
from dicedesign.concave.result import shortfall
from dicedesign.errors import DiceError
from dicedesign.geometry.sphere import angle_between, foot_on_line
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates import Coordinates, VertexCoordinates
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.candidate import CandidateMaker, LevenbergMarquardt
from dicedesign.rest.outcomes import assign_rests
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE

FOLLOWED_COSINE = math.cos(math.radians(35.0))
"""Cosine of the largest angle from an outcome's direction to a rest that is taken for it."""

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
    def facets(self) -> Integers:
        """(k,) facet of each outcome: the rest nearest to its direction, or the nearest facet if
        that rest is far or nearer to another outcome."""
        hull, rests = self.rests.hull, self.rests.paths.rests
        cosines = self.directions @ self.rest_normals.T
        main = cosines.argmax(axis=1)
        nearest = cosines.max(axis=1)
        owner = cosines[:, main].argmax(axis=0)
        is_lost = (nearest < FOLLOWED_COSINE) | (owner != np.arange(len(main)))
        nearest_facets = (self.directions @ hull.normals.T).argmax(axis=1)
        return np.where(is_lost, nearest_facets, rests[main])

    @cached_property
    def of_rest(self) -> Integers:
        """(r,) outcome of each rest: the one with the nearest facet."""
        return np.asarray((self.rest_normals @ self.normals.T).argmax(axis=1), dtype=np.int64)

    @property
    def alone(self) -> bool:
        """Whether the outcomes' facets are all rests, one each, and there are no others."""
        return np.array_equal(np.sort(self.facets), np.sort(self.rests.paths.rests))

    @property
    def normals(self) -> Floats:
        """(k, 3) normals of the outcomes' facets."""
        return self.rests.hull.normals[self.facets]

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) probabilities of the outcomes."""
        sums = np.bincount(
            self.of_rest, self.rests.probability_values, minlength=len(self.directions)
        )
        return np.asarray(sums, dtype=np.float64)

    @cached_property
    def apart(self) -> float:
        """Smallest angle between the facets of two outcomes, in radians."""
        pairs = np.stack(np.triu_indices(len(self.directions), 1))
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
        outside of a facet that is no rest and not near that of an outcome, over the circumscribed
        radius; 0 if there are other rests, or an outcome has none."""
        depths, normals = self.rests.depths, self.rests.hull.normals
        if not self.alone:
            return 0.0
        aside = (normals @ self.normals.T).max(axis=1) < math.cos(SAME_REST_ANGLE)
        rests = depths[self.rests.paths.rests]
        return max(0.0, float(np.concatenate([rests, -depths[aside]]).min()))

    @property
    def jacobian(self) -> Floats:
        """(k, n, 3) derivatives of the probabilities by the corners."""
        rests = self.rests
        sums = np.zeros((len(self.directions), *self.corners.shape))
        by_corner = rests.jacobian.reshape(len(self.of_rest), -1, 3)
        for outcome in range(len(sums)):
            sums[outcome, rests.hull.source] = by_corner[self.of_rest == outcome].sum(axis=0)
        return sums


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


HALVINGS = 3
"""Number of step lengths that are tried, each half of the one before."""

CORRECTIONS = 6
"""Maximum number of final Newton steps to the probabilities."""

MAX_GROUPS = 16
"""Maximum number of groups of corners that are eased in turn."""


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
