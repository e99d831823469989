"""Normals of the outcomes' facets near the barycenters of their basins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.optimize.energy.term import SMALLEST_MEAN
from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["USUAL_OFFSET", "margin_residuals"]

USUAL_OFFSET: Final = 0.1
"""Root of the mean square distance of ordinary normals from the barycenters of their basins."""


def margin_residuals(die: BearingFacets) -> Tensor:
    """Offsets of the normals from the barycenters. These are the true ones: the mean of the maxima
    on the border, which eq. 14 takes for them, jumps where a maximum joins or leaves."""
    import torch

    from dicedesign.rest.asymmetry import basin_moments
    from dicedesign.rest.morse import separatrix_points

    rests = die.rests
    points = separatrix_points(rests.paths, rests.vertices, rests.center, torch)
    moments = basin_moments(rests.paths, points, torch)
    lengths = torch.linalg.vector_norm(moments, dim=1, keepdim=True)
    offsets = rests.rest_normals - moments / lengths.clamp_min(SMALLEST_MEAN)
    return offsets.reshape(-1) / (USUAL_OFFSET * np.sqrt(len(die.facets)))


PREFERENCES.register(
    Preference(
        name="margin",
        line="normals of the outcomes' facets near the barycenters of their basins (eq. 14)",
        rank=1,
        residuals=margin_residuals,
    )
)
