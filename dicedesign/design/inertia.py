"""Center of mass and inertia of a uniform solid as a differentiable function of its vertices."""

from __future__ import annotations

import torch
from torch import Tensor

from dicedesign.geometry.hull import ConvexHull

__all__ = ["hull_inertia"]


def hull_inertia(vertices: Tensor, hull: ConvexHull) -> tuple[Tensor, Tensor]:
    """Centroid (3,) of the uniform solid in a hull, and its tensor of inertia (3, 3) about that
    over its mass, as functions of the vertices (n, 3).

    Source: second moments of a tetrahedron, as in `dicedesign.geometry.mass.solid_inertia`.
    """
    triangles = torch.as_tensor(hull.triangles)
    inside = vertices.mean(0)
    a, b, c = (vertices[triangles[:, corner]] - inside for corner in range(3))
    volumes = (a * torch.linalg.cross(b, c)).sum(-1)
    volumes = volumes / volumes.sum()
    centroid = (volumes[:, None] * (a + b + c)).sum(0) / 4.0
    moments = -torch.outer(centroid, centroid)
    for arm in (a, b, c, a + b + c):
        moments = moments + (volumes[:, None] * arm).T @ arm / 20.0
    identity = torch.eye(3, dtype=vertices.dtype)
    return inside + centroid, moments.diagonal().sum() * identity - moments
