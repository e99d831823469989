"""Odds against target: E_diceSimple and E_dice (eq. 11, 12)."""

from __future__ import annotations

import torch
from torch import Tensor

from dicedesign.design.energy.clusters import Clusters
from dicedesign.runtime.arrays import Floats

__all__ = ["dice_energy", "dice_simple_energy"]


def dice_simple_energy(probabilities: Tensor, assigned: Tensor) -> Tensor:
    """E_diceSimple (eq. 11): squared differences of each facet's probability (r,) from the one
    assigned to it (r,), which is 0 for facets without an outcome."""
    return ((probabilities - assigned) ** 2).sum()


def dice_energy(probabilities: Tensor, clusters: Clusters, target: Floats) -> Tensor:
    """E_dice (eq. 12): squared differences of the clusters' probabilities from the target (k,)."""
    wanted = torch.as_tensor(target, dtype=torch.float64)
    return ((clusters.sums(probabilities) - wanted) ** 2).sum()
