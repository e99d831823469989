"""Corners of half-spaces, in torch."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dicedesign.geometry.hulls.hull import convex_hull


def corner_formula(parameters: Tensor, origin: np.ndarray) -> Tensor:
    """(n, 3) corners for facet coordinates around an origin."""
    count = len(parameters) // 4
    normals = parameters[: 3 * count].reshape(count, 3)
    sizes = torch.linalg.vector_norm(normals, dim=1)
    polar = normals / (sizes * torch.exp(parameters[3 * count :]))[:, None]
    hull = convex_hull(polar.detach().numpy())
    planes = polar[torch.as_tensor(hull.source[hull.triangles])]
    corners = torch.linalg.solve(planes, torch.ones(planes.shape[:2], dtype=torch.float64))
    return torch.as_tensor(origin) + corners
