"""Rests clustered to outcomes by direction (section 3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.gradient.rest_probabilities import RestEvaluation
    from dicedesign.runtime.arrays import Floats, Integers


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
        import torch

        zeros = torch.zeros(len(self.directions), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.of_rest), probabilities)

    @property
    def empty(self) -> int:
        """Number of outcomes without a rest."""
        return len(self.directions) - len(np.unique(self.of_rest))

    def means(self, rest_normals: Floats) -> tuple[Floats, Floats]:
        """Normalized mean normals (k, 3) of the clusters, from normals of all rests (r, 3), and the
        lengths (k, 1) of their sums. An empty cluster keeps its direction (section 3.2)."""
        sums = np.zeros_like(self.directions)
        np.add.at(sums, self.of_rest, rest_normals)
        length = np.sqrt((sums * sums).sum(-1))[:, None]
        means = np.where(length > 0.0, sums / np.where(length > 0.0, length, 1.0), self.directions)
        return means, length


def cluster(rest_normals: Floats, directions: Floats) -> Clusters:
    """Assign each rest (r, 3) to the nearest direction (k, 3) (section 3.2)."""
    return Clusters(np.argmax(rest_normals @ directions.T, axis=1), directions)


@dataclass(frozen=True)
class ClusteredRests:
    """The current shape of a descent, as energy terms see it.

    Attributes
    ----------
    rests: hull and rests; tensors are functions of its `vertices` (n, 3), such as
        `rests.center_of_mass` (3,), `rests.probabilities` (r,), `rests.rest_normals` (r, 3),
        `rests.facet_depths` (m,), `rests.facet_areas` (m,) and `rests.facet_normals(facets)`.
    clusters: which outcome each rest counts for, and the outcomes' directions.
    target: (k,) target probabilities of the outcomes.
    """

    rests: RestEvaluation
    clusters: Clusters
    target: Floats

    @classmethod
    def of(cls, rests: RestEvaluation, directions: Floats, target: Floats) -> ClusteredRests:
        """Rests clustered by the nearest directions (k, 3), with target probabilities (k,)."""
        return cls(rests, cluster(rests.hull.normals[rests.facets], directions), target)

    @property
    def hull(self) -> ConvexHull:
        """The hull, as numbers."""
        return self.rests.hull

    @cached_property
    def bearing(self) -> Integers:
        """(b,) facets that bear the outcomes, at most one for each: the deepest rest of its
        cluster.

        For an outcome without a rest it is, of the unstable facets nearer to its direction than to
        any other, the one with the largest sum of cosine and depth, if there is any.
        """
        normals, directions, depths = self.hull.normals, self.clusters.directions, self.rests.depths
        rests, of_rest = self.rests.facets, self.clusters.of_rest
        bearing = np.full(len(directions), -1)
        # Rests that are equally deep but for rounding are taken in order.
        deepest_last = np.argsort(depths[rests].round(9), kind="stable")
        bearing[of_rest[deepest_last]] = rests[deepest_last]
        for outcome in np.flatnonzero(bearing < 0):
            cosines = normals @ directions.T
            is_candidate = np.argmax(cosines, axis=1) == outcome
            is_candidate[rests] = False
            candidates = np.flatnonzero(is_candidate)
            if len(candidates) > 0:
                worth = cosines[candidates, outcome] + np.clip(depths[candidates], -1.0, 1.0)
                bearing[outcome] = candidates[np.argmax(worth)]
        return bearing[bearing >= 0]

    @property
    def outcome_probabilities(self) -> Tensor:
        """(k,) of the outcomes."""
        return self.clusters.sums(self.rests.probabilities)

    @property
    def saddles(self) -> Tensor:
        """(s, 3) saddles of the rests."""
        return self.rests.saddles

    @property
    def maxima(self) -> Tensor:
        """(2 s, 3) maxima of the rests."""
        return self.rests.maxima
