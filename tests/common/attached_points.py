"""Points of a shape as a tensor."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.hulls.reuse import HullMaker
from dicedesign.optimize.coordinates.shape import Coordinates, Shape


class _Attached(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, parameters: Tensor, shape: Shape) -> Tensor:
        ctx.shape = shape
        return torch.from_numpy(shape.points)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        return torch.from_numpy(ctx.shape.pulled_back(gradient.numpy()[None])[0]), None


def attached_points(
    coordinates: Coordinates, parameters: Tensor, hull_of: HullMaker = convex_hull
) -> Tensor:
    """(n, 3) the points of a shape, whose gradients the shape itself pulls back to parameters."""
    shape = coordinates.shape(parameters.detach().numpy(), hull_of)
    points: Tensor = _Attached.apply(parameters, shape)
    return points


def corner_formula(parameters: Tensor, origin: np.ndarray) -> Tensor:
    """(n, 3) the points of facet coordinates about an origin, in torch's operations."""
    count = len(parameters) // 4
    normals = parameters[: 3 * count].reshape(count, 3)
    sizes = torch.linalg.vector_norm(normals, dim=1)
    polar = normals / (sizes * torch.exp(parameters[3 * count :]))[:, None]
    hull = convex_hull(polar.detach().numpy())
    planes = polar[torch.as_tensor(hull.source[hull.triangles])]
    corners = torch.linalg.solve(planes, torch.ones(planes.shape[:2], dtype=torch.float64))
    return torch.as_tensor(origin) + corners
