"""The rests of an outcome drawn into one plane: E_cl (eq. 13)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dicedesign.optimize.energy.term import TERMS, EnergyWeights, Term

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests

__all__ = ["coplanar_energy"]


def coplanar_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """E_cl (eq. 13): squared distances of rest normals, over ordered pairs within a cluster, which
    are 2 n times those from the mean of its n normals."""
    import torch

    clusters, normals = state.clusters, state.rests.rest_normals
    of_rest = torch.as_tensor(clusters.of_rest)
    counts = torch.bincount(of_rest, minlength=len(clusters.directions)).clamp_min(1)[:, None]
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    means = zeros.index_add(0, of_rest, normals) / counts
    return (2.0 * counts[of_rest] * (normals - means[of_rest]) ** 2).sum()


TERMS.register(
    Term(
        name="coplanar",
        line="draws the rests of an outcome into one plane (lambda_cl of eq. 13)",
        rank=1,
        evaluate=coplanar_energy,
        weight=0.1,
        kernel=1,
    )
)
