"""A hull on the way to wanted odds: its clusters of rests, and steps from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import torch

from dicedesign.concave.hull.least_displacement import least_displacement
from dicedesign.concave.hull.problem import DesignedHull, HullProblem
from dicedesign.concave.hull.shortfall import shortfall
from dicedesign.concave.hull.slopes import SlopeMemory, climbs
from dicedesign.errors import DiceError
from dicedesign.geometry.sphere import angle_between, foot_on_line
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates.vertices import VertexCoordinates
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.candidate import CandidateMaker
from dicedesign.optimize.solvers.levenberg_marquardt import LevenbergMarquardt
from dicedesign.rest.outcomes import gathered
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["HullDraft", "change_of_least_work", "designed_hull", "exact_draft"]

LARGEST_GAIN: Final = 0.05
"""Most by which odds are to change in one step."""

EXACT: Final = 1e-12
"""Largest |p - q| of an exact draft."""

SMOOTH: Final = SobolevOptions(smoothing=5.0, power=2)
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
        """None where the center of mass is outside, or the hull is none."""
        try:
            rests = evaluate_rests(torch.from_numpy(corners), torch.zeros(3, dtype=torch.float64))
            draft = cls(corners, rests, directions)
            return draft if np.isfinite(rests.odds).all() else None
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
        return len(self.rests.odds) == len(self.main) == len(np.unique(self.main))

    @property
    def normals(self) -> Floats:
        """(k, 3) those of the outcomes' own rests."""
        return self.rest_normals[self.main]

    @cached_property
    def odds(self) -> Floats:
        """(k,) of the outcomes."""
        sums = np.bincount(self.of_rest, self.rests.odds, minlength=len(self.main))
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
        """See `DesignedHull.error`."""
        return gathered(self.rest_normals, self.rests.odds, self.normals).error(target)

    def lacks_at_most(self, problem: HullProblem, missing: float) -> bool:
        """Whether the shortfall is no more than so much, which the odds alone often tell."""
        error = self.error(problem.target)
        if error > (1.0 + missing) * problem.tolerance:
            return False
        return self.shortfall(problem) <= missing

    def shortfall(self, problem: HullProblem) -> float:
        """How far odds, angles between outcomes and margin are from what will do, over what will
        do, summed; 0 where nothing is missing."""
        apart, margin = (self.apart, problem.apart), (self.margin, problem.margin)
        return shortfall(self.error(problem.target), problem.tolerance, apart, margin)

    @property
    def jacobian(self) -> Floats:
        """(k, n, 3) of the odds in the corners."""
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
    """(n, 3) from a draft to the displacement of least work with the target's odds."""
    displacement = draft.corners - problem.hull.vertices
    displacement = displacement + problem.shift(displacement)
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


def designed_hull(problem: HullProblem, draft: HullDraft) -> DesignedHull:
    """A draft as the hull to fill, where the surface would be led by its corners alone."""
    own, moved = draft.rests.hull, draft.corners - problem.hull.vertices
    error = draft.error(problem.target)
    return problem.designed(own.vertices, own.source, moved, draft.normals, error)


class _AllCorners(VertexCoordinates):
    """Corners that leave the hull stay parameters: each is a point of the surface."""

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        return parameters


def exact_draft(problem: HullProblem, draft: HullDraft) -> HullDraft | None:
    """The hull with the odds of the target to rounding to which steps lead from a draft with no
    rests but the wanted ones; None where they lead to none."""
    if not draft.alone:
        return None
    maker = CandidateMaker(np.zeros(3))
    coordinates = _AllCorners(np.zeros(3), 1.0)
    first = maker.attempt(coordinates, draft.corners.ravel(), draft.normals)
    if first is None:
        return None
    steps = LevenbergMarquardt(
        problem.target, maker, SMOOTH, EXACT / 2.0, lambda: False, lambda trial: None
    )
    trial = steps.solve(first)
    if trial.error(problem.target) > EXACT:
        return None
    return HullDraft.of(trial.parameters.reshape(-1, 3), trial.directions)
