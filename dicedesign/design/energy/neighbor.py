"""Facets near an outcome's direction drawn to it: E_nb (eq. 15)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dicedesign.design.energy.clusters import Clusters
from dicedesign.gradient.rest_odds import RestEvaluation

__all__ = ["neighbor_energy"]


def neighbor_energy(rests: RestEvaluation, clusters: Clusters, radius: float) -> Tensor:
    """E_nb (eq. 15): squared distances from u_i of all facet normals within `radius` of it; stable
    facets or not. An outcome without a facet nearby is charged the squared radius."""
    normals = rests.hull.normals
    squared = ((clusters.directions[:, None, :] - normals[None, :, :]) ** 2).sum(-1)
    outcome, facet = np.nonzero(squared < radius**2)
    alone = len(clusters.directions) - len(np.unique(outcome))
    offset = rests.facet_normals(facet) - torch.as_tensor(clusters.directions[outcome])
    return (offset**2).sum() + alone * radius**2
