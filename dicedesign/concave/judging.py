"""What a concave die does, whatever it was designed for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.poses import RestPoses
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = ["ClusterOdds", "cluster_odds", "clustered"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class ClusterOdds:
    """Odds by outcome.

    Attributes
    ----------
    odds: (k,) of the rests within `SAME_REST_ANGLE` of the outcome's own.
    main: (k,) number of that one among the rests, the most probable near the outcome's direction.
    outcome_of_rest: (r,) or -1.
    elsewhere: odds of all other rests together.
    """

    odds: Floats
    main: Integers
    outcome_of_rest: Integers
    elsewhere: float

    @property
    def rest_counts(self) -> Integers:
        """(k,) rests in each cluster."""
        counted = self.outcome_of_rest[self.outcome_of_rest >= 0]
        return np.asarray(np.bincount(counted, minlength=len(self.odds)), dtype=np.int64)

    def max_abs_error(self, target: Floats) -> float:
        """Largest |p - q|."""
        return float(np.abs(self.odds - target).max())

    def error(self, target: Floats) -> float:
        """The larger of that and of the odds elsewhere."""
        return max(self.max_abs_error(target), self.elsewhere)


def cluster_odds(poses: RestPoses, directions: Floats) -> ClusterOdds:
    """Odds of the clusters of rests about the outcomes' directions (k, 3), unit."""
    return clustered(poses.normals, poses.probabilities, directions)


def clustered(normals: Floats, probabilities: Floats, directions: Floats) -> ClusterOdds:
    """The same of rests with normals (r, 3) and probabilities (r,)."""
    angles = angle_between(normals[:, None, :], directions[None, :, :])
    near = angles <= SAME_REST_ANGLE
    main = np.where(
        near.any(axis=0),
        np.argmax(np.where(near, probabilities[:, None], -1.0), axis=0),
        angles.argmin(axis=0),
    )
    apart = angle_between(normals[:, None, :], normals[main][None, :, :])
    of_rest = np.where(apart.min(axis=1) <= SAME_REST_ANGLE, apart.argmin(axis=1), -1)
    counted = of_rest >= 0
    sums = np.bincount(of_rest[counted], probabilities[counted], minlength=len(directions))
    odds = np.asarray(sums, dtype=np.float64)
    elsewhere = float(probabilities[~counted].sum())
    return ClusterOdds(odds, np.asarray(main, dtype=np.int64), of_rest, elsewhere)
