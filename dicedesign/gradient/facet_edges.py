"""Distances from points in facets to the facets' edges, and smooth means instead of the least."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Integers, ragged_ranges

__all__ = ["SOFTNESS", "FacetEdges"]

SOFTNESS: Final = 12.0
"""Power of the means that take the place of a least or a largest value."""


@dataclass(frozen=True)
class FacetEdges:
    """The edges of k facets, e in all.

    Attributes
    ----------
    owner: (e,) facet of each edge, 0 to k - 1, ascending.
    first: (k,) first edge of each facet.
    tails: (e, 3) where edges start.
    lengths: (e,) of edges.
    inward: (e, 3) unit vectors in the facets, perpendicular to the edges.
    """

    owner: Integers
    first: Integers
    tails: Tensor
    lengths: Tensor
    inward: Tensor

    @classmethod
    def of(cls, rests: RestEvaluation, facets: Integers) -> FacetEdges:
        """The edges of some facets (k,) of a die."""
        hull = rests.hull
        start = hull.facet_start[facets]
        counts = hull.facet_start[facets + 1] - start
        owner, edges = ragged_ranges(start, counts)
        tails = rests.vertices[hull.tail[edges]]
        along = rests.vertices[hull.head[edges]] - tails
        lengths = torch.linalg.vector_norm(along, dim=1)
        normals = rests.facet_normals(facets)[owner]
        inward = torch.linalg.cross(normals, along) / lengths[:, None]
        return cls(owner, np.cumsum(counts) - counts, tails, lengths, inward)

    def distances(self, points: Tensor) -> Tensor:
        """(e,) signed distances of points (e, 3) from the edges' lines, positive inside. Points off
        the plane of the facet count as their feet on it."""
        return ((points - self.tails) * self.inward).sum(-1)

    def sums(self, values: Tensor) -> Tensor:
        """(k,) sums of values (e,) over the edges of each facet."""
        zeros = torch.zeros(len(self.first), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.owner), values)

    def mean_power(self, values: Tensor, power: float) -> Tensor:
        """(k,) `mean(values^power)^(1/power)` over each facet's border of values (e,), all >= 0.

        An edge weighs by its length: one that a facet gains at a corner begins with nothing.
        """
        found = values.detach().numpy()
        extreme = np.maximum if power > 0.0 else np.minimum
        unit = torch.as_tensor(extreme.reduceat(found, self.first))
        powers = (values / unit[self.owner]) ** power
        mean = self.sums(self.lengths * powers) / self.sums(self.lengths)
        return unit * mean ** (1.0 / power)
