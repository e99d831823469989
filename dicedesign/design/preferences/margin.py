"""Normals of the outcomes' facets near the barycenters of their basins."""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.design.energy.barycenter import SMALLEST_MEAN
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.rest.asymmetry import basin_moments
from dicedesign.rest.morse import separatrix_points
from dicedesign.runtime.arrays import Integers

USUAL_OFFSET: Final = 0.1
"""Root of the mean square distance of ordinary normals from the barycenters of their basins."""


def _margin(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Offsets of the normals from the barycenters. These are the true ones: the mean of the maxima
    on the border, which eq. 14 takes for them, jumps where a maximum joins or leaves."""
    points = separatrix_points(rests.paths, rests.vertices, rests.center, torch)
    moments = basin_moments(rests.paths, points, torch)
    lengths = torch.linalg.vector_norm(moments, dim=1, keepdim=True)
    offsets = rests.rest_normals - moments / lengths.clamp_min(SMALLEST_MEAN)
    return offsets.reshape(-1) / (USUAL_OFFSET * np.sqrt(len(facets)))
