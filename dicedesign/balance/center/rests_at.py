"""Odds of a body's rests as functions of its center of mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.rest.basins import Basins, find_basins
from dicedesign.rest.outcomes import gathered
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = ["Rests", "counted_for", "pose_odds", "rests_at", "top_directions"]


@dataclass(frozen=True, eq=False)
class Rests:
    """The rests of a hull with one center of mass.

    Attributes
    ----------
    center: (3,); sides: as of `find_basins`.
    facets: (k,) of the hull; normals: (k, 3) theirs; odds: (k,).
    """

    center: Floats
    sides: tuple[Basins, ...]
    facets: Integers
    normals: Floats
    odds: Floats

    def slopes(self, weights: Floats) -> Floats:
        """(r, 3) gradients in the center of mass of sums of the odds times weights (r, k); of a
        tied body the mean of those beside it."""
        hull = self.sides[0].equilibria.hull
        of_facet = np.zeros((len(weights), len(hull.normals)))
        of_facet[:, self.facets] = weights
        found = np.zeros((len(weights), 3))
        for side in self.sides:
            middle = side.equilibria.center_of_mass
            center = torch.tensor(middle, requires_grad=True)
            vertices = torch.from_numpy(hull.vertices)
            odds = RestEvaluation(side.equilibria, vertices, center, side).probabilities
            for row, slope in zip(of_facet, found, strict=True):
                by_odds = torch.from_numpy(row[side.paths.rests])
                slope += torch.autograd.grad(odds, center, by_odds, retain_graph=True)[0].numpy()
        return found / len(self.sides)


def rests_at(hull: ConvexHull, center: Floats) -> Rests | None:
    """The rests of a hull with a center of mass (3,); None where there are none to be had: it is
    not inside, or facets are too uneven for it."""
    try:
        sides = find_basins(hull, center)
    except InputError:
        return None
    if sides[0].equilibria.hull is not hull:
        return None
    of_facet = np.zeros(len(hull.normals))
    for side in sides:
        of_facet[side.paths.rests] += side.areas / (4.0 * np.pi * len(sides))
    facets = np.flatnonzero(of_facet)
    return Rests(center, sides, facets, hull.normals[facets], of_facet[facets])


def top_directions(rests: Rests, count: int) -> Floats:
    """(c, 3) down in the most probable poses, c at most `count`, each a rest with all that are
    within `SAME_REST_ANGLE` of it and not of a more probable one; by odds."""
    order = np.argsort(-rests.odds, kind="stable")
    left, own = rests.normals[order], []
    while len(left) > 0:
        own.append(left[0])
        left = left[angle_between(left, left[0]) > SAME_REST_ANGLE]
    directions = np.array(own)
    odds = gathered(rests.normals, rests.odds, directions).odds
    return directions[np.argsort(-odds, kind="stable")[:count]]


def counted_for(rests: Rests, directions: Floats) -> Booleans:
    """(c, k) whether each rest counts for each of the poses with directions (c, 3): as by
    `outcome_odds`, but for poses that have no rest within `SAME_REST_ANGLE`, which have none."""
    return _counted(rests.normals, rests.odds, directions)


def pose_odds(poses: RestPoses, directions: Floats) -> Floats:
    """(c,) odds of poses with directions (c, 3), by the same rule."""
    counted = _counted(poses.normals, poses.probabilities, directions)
    return np.asarray(counted @ poses.probabilities)


def _counted(normals: Floats, odds: Floats, directions: Floats) -> Booleans:
    found = gathered(normals, odds, directions)
    counted = found.outcome_of_rest == np.arange(len(directions))[:, None]
    near = angle_between(normals[found.main], directions) <= SAME_REST_ANGLE
    return np.asarray(counted & (near & (found.main >= 0))[:, None])
