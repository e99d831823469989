"""Dice whose odds jump when their corners are rounded as files round them.

Odds jump where a separatrix runs into a facet's normal. Nothing on the way to a better die keeps
away from such a place, and steps that may not go over a jump end right before it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.solvers.candidate import Candidate
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats

__all__ = ["largest_jump"]

TRIALS: Final = 4

ROUNDED: Final = float(np.finfo(np.float32).eps) / 2.0
"""Largest error of a coordinate in single precision, over its size."""


def largest_jump(candidate: Candidate, target: Floats, prior: Prior) -> float:
    """Largest |p - q| of copies of a die whose corners are off by what a file may be; 1 where one
    is no die. target: (k,) odds under a prior."""
    corners, center = candidate.rests.hull.vertices, candidate.rests.given_center
    size, random = float(np.abs(corners).max()), np.random.default_rng(0)
    errors = []
    for _ in range(TRIALS):
        off = ROUNDED * size * random.uniform(-1.0, 1.0, corners.shape)
        try:
            hull = convex_hull(corners + off, single_precision=True)
            poses = analyse(hull, hull.centroid if center is None else center.numpy())
            errors.append(outcome_odds(poses.under(prior), candidate.directions).error(target))
        except DiceError:
            errors.append(1.0)
    return max(errors)
