"""Both rests beside a saddle equally far from it (eq. 20, 21)."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from dicedesign.geometry.sphere import foot_on_line
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Integers

USUAL_INEQUALITY: Final = 0.4
"""Root of the weighted sum of the squares of ordinary saddles' relative differences of angles."""


def _asymmetry(rests: RestEvaluation, facets: Integers) -> Tensor:
    """2 phi - 1 of each saddle, with the sign that makes it smooth, by the root of its weight in
    rho."""
    paths = rests.paths
    tail, head = rests.vertices[paths.saddle_ends[:, 0]], rests.vertices[paths.saddle_ends[:, 1]]
    saddles = foot_on_line(tail - rests.center, head - rests.center, head - tail, torch)[:, None]
    normals = rests.rest_normals[torch.as_tensor(paths.basins)]
    cross = torch.linalg.cross(normals, saddles.expand_as(normals))
    angles = torch.atan2(torch.linalg.vector_norm(cross, dim=-1), (normals * saddles).sum(-1))
    weights = torch.as_tensor(rests.odds[paths.basins].min(axis=1))
    unequal = (angles[:, 0] - angles[:, 1]) / angles.sum(dim=1)
    return torch.sqrt(weights) * unequal / USUAL_INEQUALITY
