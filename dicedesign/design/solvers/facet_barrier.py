"""A barrier that keeps every facet what it is: a rest, or none."""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.facet_edges import SOFTNESS, FacetEdges
from dicedesign.gradient.rest_odds import RestEvaluation

__all__ = ["barrier_residuals"]

DEPTH: Final = 0.01
"""Depth of a facet, over the mean distance of the vertices, at which its residual is 1."""


def barrier_residuals(rests: RestEvaluation) -> Tensor:
    """(m,) inverse depths of the facets, which are infinite where a facet gains or loses stability.

    The depth of a rest is the distance of the foot of the center of mass from the nearest edge's
    line, that of another facet how far outside of the farthest such line it lies; for both a mean
    of high power over the facet's border takes the place of the least or largest, so that depths
    are smooth.
    """
    edges = FacetEdges.of(rests, np.arange(len(rests.hull.normals)))
    inside = edges.distances(rests.center)
    stable = torch.as_tensor(rests.equilibria.stable)
    held = edges.mean_power(torch.where(stable[edges.owner], inside, 1.0), -SOFTNESS)
    outside = torch.where(stable[edges.owner], 1.0, torch.relu(-inside))
    depths = torch.where(stable, held, edges.mean_power(outside, SOFTNESS))
    size = torch.linalg.vector_norm(rests.vertices - rests.center, dim=1).mean()
    return DEPTH * size / depths
