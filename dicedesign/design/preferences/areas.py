"""Equal areas of the outcomes' facets."""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Integers

USUAL_RATIO: Final = 0.7
"""Standard deviation of the logarithms of ordinary areas."""


def _areas(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Logarithms of the areas less their mean."""
    logarithms = torch.log(_all_areas(rests)[facets])
    return (logarithms - logarithms.mean()) / (USUAL_RATIO * np.sqrt(len(facets)))


def _all_areas(rests: RestEvaluation) -> Tensor:
    """(m,) areas of the facets, by the triangles they are cut into."""
    hull = rests.hull
    a, b, c = (rests.vertices[corner] for corner in hull.triangles.T)
    owner = np.repeat(np.arange(len(hull.normals)), np.diff(hull.facet_start) - 2)
    vectors = torch.zeros((len(hull.normals), 3), dtype=torch.float64)
    vectors = vectors.index_add(0, torch.as_tensor(owner), torch.linalg.cross(b - a, c - a))
    return torch.linalg.vector_norm(vectors, dim=1) / 2.0
