"""Corners of half-spaces as a function of their parameters, for autograd and `torch.func`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.gradient.body_function import BodyFunction, double_tensor, seen
from dicedesign.optimize.coordinates.shape import Shape
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["corner_points"]


MadeShape = Callable[[Floats], tuple[Shape, Integers]]
"""From the parameters (4 m,) of half-spaces to their shape, and to the planes (t, 3) that meet at
each corner."""


def corner_points(parameters: Tensor, origin: Floats, made: MadeShape) -> Tensor:
    """(t, 3) corners of half-spaces about an origin (3,), see `FacetCoordinates`.

    Where `torch.func.vmap` maps over shapes with different numbers of corners, the first of a shape
    comes again in the rows that are left.
    """
    given = double_tensor(parameters, "parameters", "4 m")
    if len(given) % 4 != 0:
        raise InputError(
            f"parameters: expected three numbers of a normal and one of a distance for each of m "
            f"facets, got {len(given)}; pass all normals and then all distances"
        )
    solids = _Solids(origin, made)
    which = seen(solids.find, given)
    return BodyFunction(1, 1, solids.formula, solids.value, solids.adjoint)(which, given)[0].to(
        parameters
    )


class _Solids:
    """The solids of one call."""

    def __init__(self, origin: Floats, made: MadeShape) -> None:
        self._origin, self._made = origin, made
        self._shapes: list[Shape] = []
        self._planes: list[Integers] = []

    def find(self, parameters: Floats) -> Integers:
        """Find the corners of solids (*l) with parameters (*l, 4 m), and number the solids."""
        lead = parameters.shape[:-1]
        for row in parameters.reshape(-1, parameters.shape[-1]):
            shape, planes = self._made(row)
            self._shapes.append(shape)
            self._planes.append(planes)
        counts = np.array([len(planes) for planes in self._planes])
        places = np.arange(counts.max())
        self._rows = np.where(places < counts[:, None], places, 0)
        return np.arange(len(counts)).reshape(lead)

    def value(self, which: Integers, parameters: Floats) -> tuple[Floats]:
        return (np.stack([self._shapes[solid].points[self._rows[solid]] for solid in which]),)

    def adjoint(self, which: Integers, parameters: Floats, gradients: Floats) -> tuple[Floats]:
        slopes = []
        for solid, gradient in zip(which, gradients, strict=True):
            shape = self._shapes[solid]
            by_corner = np.zeros_like(shape.points)
            np.add.at(by_corner, self._rows[solid], gradient)
            slopes.append(shape.pulled_back(by_corner[None])[0])
        return (np.stack(slopes),)

    def formula(self, solid: int, parameters: Tensor) -> tuple[Tensor]:
        count = len(parameters) // 4
        normals = parameters[: 3 * count].reshape(count, 3)
        units = normals / torch.linalg.vector_norm(normals, dim=1, keepdim=True)
        polar = units * torch.exp(-parameters[3 * count :, None])
        planes = polar[torch.from_numpy(self._planes[solid])]
        corners = torch.linalg.solve(planes, torch.ones((len(planes), 3), dtype=torch.float64))
        return (torch.from_numpy(self._origin) + corners[self._rows[solid]],)
