"""Sobolev preconditioning: gradients spread over the surface before a step is taken."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import SuperLU, splu

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.registry import STRICT

__all__ = [
    "SobolevOptions",
    "SobolevSolver",
    "check_coordinates",
    "edge_laplacian",
    "graph_laplacian",
    "sobolev_solve",
]

LARGEST_SMOOTHING: Final = 1e6
"""Beyond it the operator averages the whole surface, and its matrix is singular to rounding."""


@dataclass(frozen=True)
class SobolevOptions:
    """The operator `(I + lambda L)^-p` of section 3.3.

    Attributes
    ----------
    smoothing: lambda, above 0 and at most `LARGEST_SMOOTHING`.
    power: p, 1 to 4.
    """

    __pydantic_config__ = STRICT

    smoothing: float = 2.0
    power: int = 2

    def __post_init__(self) -> None:
        if not 0.0 < self.smoothing <= LARGEST_SMOOTHING:
            raise InputError(
                f"sobolev.smoothing: expected a number above 0 and at most "
                f"{LARGEST_SMOOTHING:g}, got {self.smoothing:g}; leave it out for 2"
            )
        if not 1 <= self.power <= 4:
            raise InputError(
                f"sobolev.power: expected 1 to 4, got {self.power}; leave it out for 2"
            )


def check_coordinates(coordinates: str, sobolev: SobolevOptions | None) -> None:
    """Raise InputError unless coordinates are "facets" or "vertices", with the operator for the
    latter only."""
    if coordinates not in ("facets", "vertices"):
        raise InputError(
            f'coordinates: expected "facets" or "vertices", got {coordinates!r}; choose one of the '
            "two"
        )
    if sobolev is not None and coordinates != "vertices":
        raise InputError(
            'sobolev: expected coordinates "vertices", whose gradient lives on the surface, got '
            f"{coordinates!r}; leave sobolev out or change coordinates"
        )


def graph_laplacian(hull: ConvexHull) -> csc_array:
    """(n, n) Laplacian L of the hull's edge graph: degree on the diagonal, -1 for each edge."""
    return edge_laplacian(hull.tail, hull.head, len(hull.vertices))


def edge_laplacian(tails: Integers, heads: Integers, size: int) -> csc_array:
    """(size, size) the same of any graph, whose edges (h,) are given in both directions."""
    adjacency = csc_array((np.ones(len(tails)), (tails, heads)), shape=(size, size))
    return csc_array(diags_array(np.asarray(adjacency.sum(axis=0)).ravel()) - adjacency)


@dataclass(frozen=True)
class SobolevSolver:
    """`(I + lambda L)^-p` with its factor, good for as long as the hull's edges stay the same.

    Attributes
    ----------
    laplacian: (n, n) symmetric positive semidefinite.
    options: lambda and p.
    """

    laplacian: csc_array
    options: SobolevOptions

    @cached_property
    def _factor(self) -> SuperLU:
        size = self.laplacian.shape[0]
        return splu(csc_array(eye_array(size) + self.options.smoothing * self.laplacian))

    def solve(self, gradient: Floats) -> Floats:
        """Apply the operator to (n, d) right-hand sides."""
        for _ in range(self.options.power):
            gradient = self._factor.solve(gradient)
        return gradient


def sobolev_solve(laplacian: csc_array, gradient: Floats, options: SobolevOptions) -> Floats:
    """`(I + lambda L)^-p gradient` in one call: `SobolevSolver(laplacian, options).solve(...)`."""
    return SobolevSolver(laplacian, options).solve(gradient)
