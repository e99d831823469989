"""Rests gathered to outcomes by direction (section 3.2), and what an energy term sees of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE


@dataclass(frozen=True)
class Clusters:
    """Outcome for which each rest counts.

    Attributes
    ----------
    of_rest: (r,) outcome of each rest.
    directions: (k, 3) the unit directions u_i of the outcomes.
    """

    of_rest: Integers
    directions: Floats

    def sums(self, probabilities: Tensor) -> Tensor:
        """(k,) summed probabilities (r,) of each cluster."""
        zeros = torch.zeros(len(self.directions), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.of_rest), probabilities)

    @property
    def empty(self) -> int:
        """Number of outcomes without a rest."""
        return len(self.directions) - len(np.unique(self.of_rest))


@dataclass(frozen=True)
class ClusteredRests:
    """The current shape of a descent: what an energy term sees.

    Attributes
    ----------
    rests: hull and rests; coordinates in torch are functions of its `vertices` (n, 3), as are
        `rests.center` (3,), `rests.probabilities` (r,), `rests.rest_normals` (r, 3),
        `rests.facet_depths` (m,) and `rests.facet_normals(facets)`.
    clusters: which outcome each rest counts for, and the outcomes' directions.
    target: (k,) wanted probabilities of the outcomes.
    """

    rests: RestEvaluation
    clusters: Clusters
    target: Floats

    @classmethod
    def of(cls, rests: RestEvaluation, directions: Floats, target: Floats) -> ClusteredRests:
        """Rests that count for the outcomes of the nearest directions (k, 3), whose target is
        (k,)."""
        normals = rests.hull.normals[rests.facets]
        return cls(rests, cluster(normals, directions), target)

    @property
    def hull(self) -> ConvexHull:
        """The hull, as numbers."""
        return self.rests.hull

    @property
    def outcome_probabilities(self) -> Tensor:
        """(k,) of the outcomes."""
        return self.clusters.sums(self.rests.probabilities)

    @property
    def saddles(self) -> Tensor:
        """(s, 3) those of the rests."""
        return self.rests.saddles

    @property
    def maxima(self) -> Tensor:
        """(2 s, 3) those of the rests."""
        return self.rests.maxima


def cluster(rest_normals: Floats, directions: Floats) -> Clusters:
    """Give each rest (r, 3) to the nearest of the directions (k, 3) (section 3.2)."""
    return Clusters(np.argmax(rest_normals @ directions.T, axis=1), directions)


def updated_directions(rest_normals: Floats, clusters: Clusters) -> Floats:
    """(k, 3) the normalised means of the clusters' normals; an empty cluster keeps its direction
    (section 3.2)."""
    sums = np.zeros_like(clusters.directions)
    np.add.at(sums, clusters.of_rest, rest_normals)
    length = np.sqrt((sums * sums).sum(-1))[:, None]
    return np.where(length > 0.0, sums / np.where(length > 0.0, length, 1.0), clusters.directions)


def outcome_facets(normals: Floats, directions: Floats, depths: Floats) -> Integers:
    """(k,) distinct facets, of normals (m, 3), that bear the outcomes of directions (k, 3).

    They lie nearest to the directions as a whole (least sum of cosines lost). Of facets that all
    lie within `SAME_REST_ANGLE` of a direction, as the parts of a facet that broke in two, the one
    of largest depth (m,) bears it: where two are equally deep they can change places and the
    stability energy is the same. With m < k facets, those of the m outcomes that get one.
    """
    # Imported here, as only some energies need it and it takes long.
    from scipy.optimize import linear_sum_assignment

    cosines = directions @ normals.T
    within = cosines > np.cos(SAME_REST_ANGLE)
    # Being within the angle is worth at least 2, more than any cosine.
    gain = np.where(within, 3.0 + np.clip(depths, -1.0, 1.0), cosines)
    return np.asarray(linear_sum_assignment(-gain)[1], dtype=np.int64)
