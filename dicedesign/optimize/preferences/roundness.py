"""Facets, and vertices, equally far from the center of mass."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["USUAL_SPREAD", "roundness_residuals"]

USUAL_SPREAD: Final = 0.2
"""Relative standard deviation of ordinary distances from the center of mass."""


def roundness_residuals(die: BearingFacets) -> Tensor:
    """Distances of vertices and of planes from the center of mass, as parts of their means."""
    import torch

    rests, hull = die.rests, die.rests.hull
    radii = rests.vertices - rests.center
    normals = rests.facet_normals(np.arange(len(hull.normals)))
    heights = (radii[hull.tail[hull.facet_start[:-1]]] * normals).sum(-1)
    return torch.cat(
        [
            (distances / distances.mean() - 1.0) / (USUAL_SPREAD * np.sqrt(len(distances)))
            for distances in (torch.linalg.vector_norm(radii, dim=1), heights)
        ]
    )


PREFERENCES.register(
    Preference(
        name="roundness",
        line="all facets equally far from the center of mass, and all vertices",
        rank=3,
        residuals=roundness_residuals,
    )
)
