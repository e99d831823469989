"""Odds of a body's rests as functions of its center of mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.rest.basins import Basins, basin_areas
from dicedesign.rest.equilibria import classify
from dicedesign.rest.morse import separatrices
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
    basins: of the body; facets: (k,) of the hull; normals: (k, 3) theirs; odds: (k,).
    """

    basins: Basins
    facets: Integers
    normals: Floats
    odds: Floats

    def slopes(self, weights: Floats) -> Floats:
        """(r, 3) gradients in the center of mass of sums of the odds times weights (r, k)."""
        equilibria = self.basins.equilibria
        center = torch.tensor(equilibria.center_of_mass, requires_grad=True)
        vertices = torch.from_numpy(equilibria.hull.vertices)
        odds = RestEvaluation(equilibria, vertices, center, self.basins).probabilities
        found = [
            torch.autograd.grad(odds, center, torch.from_numpy(row), retain_graph=True)[0].numpy()
            for row in np.ascontiguousarray(weights)
        ]
        return np.stack(found)


def rests_at(hull: ConvexHull, center: Floats) -> Rests | None:
    """The rests of a hull with a center of mass (3,); None where there are none to be had: it is
    not inside, or facets are too uneven for it.

    A body that is tied to within rounding is taken for one beside it, unlike by `rest_poses`: a
    search does not end where odds jump, and looking for ties takes up to a hundred times as long.
    """
    try:
        equilibria = classify(hull, center)
        paths = separatrices(equilibria)
        basins = Basins(equilibria, paths, basin_areas(equilibria, paths))
    except InputError:
        return None
    return Rests(basins, paths.rests, hull.normals[paths.rests], basins.areas / (4.0 * np.pi))


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
