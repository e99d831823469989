"""The center of mass of a uniform solid hull as a differentiable function of its vertices.

Center of mass and inertia of a uniform solid as a differentiable function of its vertices."""

from __future__ import annotations

import torch
from torch import Tensor

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.solid import stretch_matrix
from dicedesign.gradient.adjoint_function import adjoint_function
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["centroid_gradient", "hull_centroid", "hull_inertia"]


def hull_centroid(vertices: Tensor, hull: ConvexHull) -> Tensor:
    """Center of mass (3,) of the uniform solid hull, whose vertices (n, 3) the tensor has."""
    return adjoint_function(
        lambda: hull.centroid,
        lambda gradient: (centroid_gradient(hull, gradient),),
        lambda vertices: _centroid(vertices, hull.triangles),
        vertices,
    )


def centroid_gradient(hull: ConvexHull, gradient: Floats) -> Floats:
    """Gradient (n, 3) in the vertices for that (3,) in the center of mass of the uniform hull."""
    by_vertices = kernels.centroid_gradient(hull, gradient)
    if by_vertices is None:
        leaf = torch.tensor(hull.vertices, requires_grad=True)
        with torch.enable_grad():
            along = _centroid(leaf, hull.triangles) @ torch.as_tensor(gradient)
        by_vertices = torch.autograd.grad(along, leaf)[0].numpy()
    return by_vertices


def _centroid(vertices: Tensor, triangles: Integers) -> Tensor:
    """That of a needle or a plate is computed before it is stretched (`stretch_matrix`); the
    stretch counts as constant, as it changes the rounding only."""
    origin = vertices.detach().mean(dim=0)
    offsets = vertices - origin
    centroid, sixfold = _sums(offsets, triangles)
    stretch = stretch_matrix(offsets.detach().numpy(), sixfold.item() / 6.0)
    if stretch is not None:
        matrix = torch.as_tensor(stretch)
        image = torch.linalg.solve(matrix, offsets, left=False)
        centroid = _sums(image, triangles)[0] @ matrix
    return origin + centroid


def _sums(offsets: Tensor, triangles: Integers) -> tuple[Tensor, Tensor]:
    """Centroid (3,) and sixfold volume by tetrahedra from the origin."""
    a, b, c = (offsets[triangles[:, k]] for k in range(3))
    sixfold = (a * torch.linalg.cross(b, c)).sum(-1)
    moment = (sixfold[:, None] * (a + b + c)).sum(0) / 4.0
    total = sixfold.sum()
    return moment / total, total


def hull_inertia(vertices: Tensor, hull: ConvexHull) -> tuple[Tensor, Tensor]:
    """Centroid (3,) of the uniform solid in a hull, and its tensor of inertia (3, 3) about that
    over its mass, as functions of the vertices (n, 3).

    Source: second moments of a tetrahedron, as in `dicedesign.geometry.solid.solid_inertia`.
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
