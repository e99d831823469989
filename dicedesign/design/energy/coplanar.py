"""The rests of an outcome drawn into one plane: E_cl (eq. 13)."""

from __future__ import annotations

import torch
from torch import Tensor

from dicedesign.design.energy.clusters import Clusters

__all__ = ["coplanar_energy"]


def coplanar_energy(rest_normals: Tensor, clusters: Clusters) -> Tensor:
    """E_cl (eq. 13): squared distances of normals (r, 3), over ordered pairs within a cluster,
    which are 2 n times those from the mean of its n normals."""
    of_rest = torch.as_tensor(clusters.of_rest)
    counts = torch.bincount(of_rest, minlength=len(clusters.directions)).clamp_min(1)[:, None]
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    means = zeros.index_add(0, of_rest, rest_normals) / counts
    return (2.0 * counts[of_rest] * (rest_normals - means[of_rest]) ** 2).sum()
