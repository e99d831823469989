"""One stable facet for each outcome and no other, by a margin."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dicedesign.design.energy.clusters import Clusters, outcome_facets
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Floats

__all__ = ["stability_energy"]


def stability_energy(rests: RestEvaluation, clusters: Clusters, margin: float) -> Tensor:
    """Keeps one facet for each outcome stable and all others unstable, by a margin.

    A facet of depth s (`RestEvaluation.facet_depths`) with an outcome pays
    `max(0, 1 - s / margin)^2`, another one the same with -s. Probabilities jump where a depth
    crosses zero; this wall in front of the jump is what lets a smooth method walk along it. Not in
    the paper.
    """
    depths = rests.facet_depths
    signs, least = _sides(rests.hull, clusters, depths.detach().numpy(), margin)
    return (torch.relu(1.0 - torch.as_tensor(signs) * depths / margin) ** 2).sum() + least


def _sides(
    hull: ConvexHull, clusters: Clusters, depths: Floats, margin: float
) -> tuple[Floats, float]:
    """1 for each facet (m,) with an outcome, -1 for others, and the charge for outcomes that have
    none."""
    signs = np.full(len(hull.normals), -1.0)
    wanted = outcome_facets(hull.normals, clusters.directions, depths)
    signs[wanted] = 1.0
    return signs, (len(clusters.directions) - len(wanted)) * (1.0 + 1.0 / margin) ** 2
