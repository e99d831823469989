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
    """Face for which each rest counts; an outcome has one, or several.

    Attributes
    ----------
    of_rest: (r,) face of each rest.
    directions: (f, 3) the unit directions u_i of the faces.
    """

    of_rest: Integers
    directions: Floats

    def sums(self, probabilities: Tensor) -> Tensor:
        """(f,) summed probabilities (r,) of each cluster."""
        import torch

        zeros = torch.zeros(len(self.directions), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.of_rest), probabilities)

    @property
    def empty(self) -> int:
        """Number of faces without a rest."""
        return len(self.directions) - len(np.unique(self.of_rest))

    def means(self, rest_normals: Floats) -> tuple[Floats, Floats]:
        """Normalized mean normals (f, 3) of the clusters, from normals of all rests (r, 3), and the
        lengths (f, 1) of their sums. An empty cluster keeps its direction (section 3.2)."""
        sums = np.zeros_like(self.directions)
        np.add.at(sums, self.of_rest, rest_normals)
        length = np.sqrt((sums * sums).sum(-1))[:, None]
        means = np.where(length > 0.0, sums / np.where(length > 0.0, length, 1.0), self.directions)
        return means, length


def cluster(rest_normals: Floats, directions: Floats) -> Clusters:
    """Assign each rest (r, 3) to the nearest direction (f, 3) (section 3.2)."""
    return Clusters(np.argmax(rest_normals @ directions.T, axis=1), directions)


@dataclass(frozen=True)
class ClusteredRests:
    """The current shape of a descent, as energy terms see it.

    Attributes
    ----------
    rests: hull and rests; tensors are functions of its `vertices` (n, 3), such as
        `rests.center_of_mass` (3,), `rests.probabilities` (r,), `rests.rest_normals` (r, 3),
        `rests.facet_depths` (m,), `rests.facet_areas` (m,) and `rests.facet_normals(facets)`.
    clusters: which face each rest counts for, and the faces' directions.
    target: (k,) target probabilities of the outcomes.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    """

    rests: RestEvaluation
    clusters: Clusters
    target: Floats
    outcome_of: Integers | None = None

    @classmethod
    def of(
        cls,
        rests: RestEvaluation,
        directions: Floats,
        target: Floats,
        outcome_of: Integers | None = None,
    ) -> ClusteredRests:
        """Rests clustered by the nearest directions (f, 3), with target probabilities (k,)."""
        clusters = cluster(rests.hull.normals[rests.facets], directions)
        return cls(rests, clusters, target, outcome_of)

    @property
    def hull(self) -> ConvexHull:
        """The hull, as numbers."""
        return self.rests.hull

    @cached_property
    def bearing(self) -> Integers:
        """(b,) facets that bear the faces, at most one for each: the deepest rest of its cluster.

        For a face without a rest it is, of the unstable facets nearer to its direction than to any
        other, the one with the largest sum of cosine and depth, if there is any.
        """
        normals, directions, depths = self.hull.normals, self.clusters.directions, self.rests.depths
        rests, of_rest = self.rests.facets, self.clusters.of_rest
        bearing = np.full(len(directions), -1)
        # Rests that are equally deep but for rounding are taken in order.
        deepest_last = np.argsort(depths[rests].round(9), kind="stable")
        bearing[of_rest[deepest_last]] = rests[deepest_last]
        for face in np.flatnonzero(bearing < 0):
            cosines = normals @ directions.T
            is_candidate = np.argmax(cosines, axis=1) == face
            is_candidate[rests] = False
            candidates = np.flatnonzero(is_candidate)
            if len(candidates) > 0:
                worth = cosines[candidates, face] + np.clip(depths[candidates], -1.0, 1.0)
                bearing[face] = candidates[np.argmax(worth)]
        return bearing[bearing >= 0]

    @property
    def outcome_probabilities(self) -> Tensor:
        """(k,) of the outcomes."""
        import torch

        sums = self.clusters.sums(self.rests.probabilities)
        if self.outcome_of is None:
            return sums
        zeros = torch.zeros(len(self.target), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.outcome_of), sums)

    @cached_property
    def misses(self) -> Floats:
        """(k,) p - q of the outcomes, as numbers."""
        by_face, faces = self.rests.probability_values, len(self.clusters.directions)
        sums = np.bincount(self.clusters.of_rest, by_face, faces)
        if self.outcome_of is not None:
            sums = np.bincount(self.outcome_of, sums)
        return np.asarray(sums - self.target)

    @property
    def face_target(self) -> Floats:
        """(f,) probabilities of the faces at which each face misses as much as its outcome does
        now: the gradient of half the sum of squares over the faces is then that over the
        outcomes."""
        if self.outcome_of is None:
            return np.asarray(self.target, dtype=np.float64)
        faces = len(self.clusters.directions)
        by_face = np.bincount(self.clusters.of_rest, self.rests.probability_values, faces)
        return np.asarray(by_face - self.misses[self.outcome_of])

    @property
    def saddles(self) -> Tensor:
        """(s, 3) saddles of the rests."""
        return self.rests.saddles

    @property
    def maxima(self) -> Tensor:
        """(2 s, 3) maxima of the rests."""
        return self.rests.maxima
