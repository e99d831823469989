"""Center of mass and inertia of a uniform solid hull, differentiable in its vertices."""

from __future__ import annotations

import torch
from torch import Tensor

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.solid import second_moments, stretch_matrix, volume_and_centroid
from dicedesign.gradient.body_function import adjoint_function
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers


def hull_centroid(vertices: Tensor, hull: ConvexHull) -> Tensor:
    """Center of mass (3,) of the uniform solid hull, whose vertices (n, 3) the tensor has."""
    return adjoint_function(
        hull.centroid,
        lambda gradient: (centroid_gradient(hull, gradient),),
        lambda vertices: _centroid(vertices, hull.triangles),
        vertices,
    )


def centroid_gradient(hull: ConvexHull, gradient: Floats) -> Floats:
    """Gradient (n, 3) in the vertices for that (3,) in the center of mass of the uniform hull."""
    by_vertices = kernels.centroid_gradient(hull, gradient)
    if by_vertices is kernels.UNDECIDED:
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
    volume, centroid = volume_and_centroid(offsets, triangles, torch)
    stretch = stretch_matrix(offsets.detach().numpy(), volume.item())
    if stretch is not None:
        matrix = torch.as_tensor(stretch)
        image = torch.linalg.solve(matrix, offsets, left=False)
        centroid = volume_and_centroid(image, triangles, torch)[1] @ matrix
    return origin + centroid


def hull_inertia(vertices: Tensor, hull: ConvexHull) -> tuple[Tensor, Tensor]:
    """Centroid (3,) of the uniform solid in a hull, and its tensor of inertia (3, 3) about that
    over its mass, as functions of the vertices (n, 3); see `dicedesign.geometry.solid`."""
    centroid = _centroid(vertices, hull.triangles)
    moments, volume = second_moments(vertices - centroid, hull.triangles, torch)
    moments = moments / volume
    return centroid, moments.trace() * torch.eye(3, dtype=vertices.dtype) - moments
