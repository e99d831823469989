"""Facets, and vertices, equally far from the center of mass."""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Integers

USUAL_SPREAD: Final = 0.2
"""Relative standard deviation of ordinary distances from the center of mass."""


def _roundness(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Distances of vertices and of planes from the center of mass, as parts of their means."""
    hull = rests.hull
    radii = rests.vertices - rests.center
    normals = rests.facet_normals(np.arange(len(hull.normals)))
    heights = (radii[hull.tail[hull.facet_start[:-1]]] * normals).sum(-1)
    return torch.cat(
        [
            (distances / distances.mean() - 1.0) / (USUAL_SPREAD * np.sqrt(len(distances)))
            for distances in (torch.linalg.vector_norm(radii, dim=1), heights)
        ]
    )
