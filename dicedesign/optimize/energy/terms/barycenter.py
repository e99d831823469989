"""Rests drawn to the middle of their region: E_bc (eq. 14)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.optimize.energy.term import (
    LARGEST_SQUARED_DISTANCE,
    SMALLEST_MEAN,
    TERMS,
    EnergyWeights,
    Term,
)

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests

__all__ = ["barycenter_energy"]


def barycenter_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """E_bc (eq. 14): squared distances of rest normals from the barycenter of their cluster's
    region, which is the normalised mean of the maxima on the region's border."""
    import torch

    rests, clusters, paths = state.rests, state.clusters, state.rests.paths
    sides = clusters.of_rest[paths.basins]
    borders = np.flatnonzero(sides[:, 0] != sides[:, 1])
    energy = LARGEST_SQUARED_DISTANCE * clusters.empty * torch.ones((), dtype=torch.float64)
    if len(borders) == 0:
        return energy
    branch = np.stack([2 * borders, 2 * borders + 1], axis=1)
    outcome = np.repeat(sides[borders].ravel(), 2)
    peak = np.repeat(paths.maxima[branch][:, None, :], 2, axis=1).ravel()
    outcome, peak = np.unique(np.stack([outcome, peak]), axis=1)
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    sums = zeros.index_add(0, torch.as_tensor(outcome), rests.vertex_directions(peak))
    lengths = torch.linalg.vector_norm(sums, dim=1, keepdim=True)
    barycenters = sums / lengths.clamp_min(SMALLEST_MEAN)
    bordered = np.isin(clusters.of_rest, outcome)
    own = barycenters[clusters.of_rest[bordered]]
    return energy + ((rests.rest_normals[bordered] - own) ** 2).sum()


TERMS.register(
    Term(
        name="barycenter",
        line="draws the rests of an outcome to the middle of its region (lambda_bc of eq. 14)",
        rank=2,
        evaluate=barycenter_energy,
        weight=2.0,
        kernel=2,
    )
)
