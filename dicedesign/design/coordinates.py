"""What a design varies: vertices, as in the paper, or facets, which stay flat by construction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign import kernels
from dicedesign.design.differentiable import RestEvaluation
from dicedesign.design.kernel_functions import adjoint_function
from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hull import convex_hull
from dicedesign.geometry.hull_reuse import HullMaker
from dicedesign.geometry.sphere import norms

__all__ = ["Coordinates", "FacetCoordinates", "Shape", "VertexCoordinates"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Shape:
    """Points whose hull is a shape, as a function of p parameters.

    Attributes
    ----------
    points: (n, 3).
    pulled_back: from gradients (r, n, 3) in the points to those (r, p) in the parameters.
    formula: the same function of parameters near these, in torch's operations.
    """

    points: Floats
    pulled_back: Callable[[Floats], Floats]
    formula: Callable[[Tensor], Tensor]

    def in_parameters(self, rows: Floats, source: Integers) -> Floats:
        """Gradients (r, p) in the parameters for those (r, 3 v) in some of the points, (v,) by
        number."""
        gradients = np.zeros((len(rows), *self.points.shape))
        gradients[:, source] = rows.reshape(len(rows), len(source), 3)
        return self.pulled_back(gradients)

    def attached(self, parameters: Tensor) -> Tensor:
        """(n, 3) the points, differentiable in the tensor of the parameters."""

        return adjoint_function(
            (self.points,),
            lambda gradient: (self.pulled_back(gradient[None])[0],),
            lambda parameters: (self.formula(parameters),),
            parameters,
        )[0]


class Coordinates(Protocol):
    """Parameters of a convex shape, as a flat array."""

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """The shape; `hull_of` makes the hulls that are needed on the way."""

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """(n, 3) its points, differentiable in the parameters."""

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """The parameters without what the shape no longer uses."""


@dataclass(frozen=True)
class VertexCoordinates:
    """The vertices themselves: parameters are (n, 3) flattened, in units of `scale` from `origin`.

    Attributes
    ----------
    origin: (3,) the point that scaling keeps.
    scale: length of one unit.
    """

    origin: Floats
    scale: float

    @classmethod
    def of(
        cls, points: Floats, origin: Floats, hull_of: HullMaker = convex_hull
    ) -> tuple[VertexCoordinates, Floats]:
        """Coordinates about an origin (3,), and the parameters of the hull of points (n, 3)."""
        hull = hull_of(points)
        offsets = hull.vertices - origin
        scale = float(np.abs(offsets).max())
        return cls(origin, scale), (offsets / scale).ravel()

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `Coordinates`."""

        def pulled_back(gradients: Floats) -> Floats:
            return self.scale * gradients.reshape(len(gradients), len(parameters))

        def formula(parameters: Tensor) -> Tensor:
            return torch.as_tensor(self.origin) + self.scale * parameters.reshape(-1, 3)

        return Shape(self.origin + self.scale * parameters.reshape(-1, 3), pulled_back, formula)

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`."""
        return self.shape(parameters.detach().numpy(), hull_of).attached(parameters)

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `Coordinates`: drops points that are no vertices of the hull."""
        return parameters.reshape(-1, 3)[rests.hull.source].ravel()


@dataclass(frozen=True)
class FacetCoordinates:
    """Half-spaces `n_i . (x - origin) <= exp(l_i)`: parameters are the m normals (not necessarily
    unit) followed by the m values l_i.

    Attributes
    ----------
    origin: (3,) a point inside the shape.
    """

    origin: Floats

    @classmethod
    def of(
        cls, points: Floats, origin: Floats, hull_of: HullMaker = convex_hull
    ) -> tuple[FacetCoordinates, Floats]:
        """Coordinates about an origin (3,) inside, and the parameters of the hull of points (n, 3).

        Raises DegenerateBodyError if the origin is not strictly inside.
        """
        hull = hull_of(points)
        heights = hull.heights(origin)
        if (heights <= 0.0).any():
            raise DegenerateBodyError(
                f"facet coordinates: expected an origin inside the shape, got {origin.tolist()}; "
                "take its centroid"
            )
        return cls(origin), np.concatenate([hull.normals.ravel(), np.log(heights)])

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `Coordinates`: one corner for each triangle of the polar hull, from the three planes
        that meet there. Raises DegenerateBodyError if the half-spaces bound no solid."""
        count = len(parameters) // 4
        normals = parameters[: 3 * count].reshape(count, 3)
        sizes = norms(normals)
        with np.errstate(all="ignore"):
            # A hull tells what is no number.
            units, inverse = normals / sizes[:, None], np.exp(-parameters[3 * count :])
            polar = units * inverse[:, None]
        hull = hull_of(polar)
        if (hull.heights(np.zeros(3)) <= 0.0).any():
            raise DegenerateBodyError(
                "facet coordinates: expected half-spaces that bound a solid, got normals that "
                "leave a direction open; take a smaller step"
            )
        facets = hull.source[hull.triangles]
        planes = polar[facets]
        corners = np.linalg.solve(planes, np.ones((len(planes), 3, 1)))[..., 0]

        def pulled_back(gradients: Floats) -> Floats:
            rows = gradients.reshape(len(gradients), corners.size)
            if kernels.compiled is not None:
                found: Floats = kernels.compiled.corner_gradients(
                    normals, polar, facets.ravel(), corners, rows
                )
                return found
            # Of the solution of three equations, in each of them.
            right = rows.T.reshape(len(corners), 3, len(rows))
            shares = np.linalg.solve(np.swapaxes(planes, 1, 2), right)
            by_plane = -shares[:, :, None, :] * corners[:, None, :, None]
            by_polar = np.zeros((count, 3, len(rows)))
            np.add.at(by_polar, facets, by_plane)
            along = (units[..., None] * by_polar).sum(axis=1)
            across = by_polar - units[..., None] * along[:, None]
            across *= (inverse / sizes)[:, None, None]
            by_logarithm = -inverse[:, None] * along
            return np.concatenate([across.reshape(3 * count, len(rows)), by_logarithm]).T

        def formula(parameters: Tensor) -> Tensor:
            normals = parameters[: 3 * count].reshape(count, 3)
            sizes = torch.linalg.vector_norm(normals, dim=1)
            polar = normals / (sizes * torch.exp(parameters[3 * count :]))[:, None]
            ones = torch.ones(len(facets), 3, dtype=torch.float64)
            corners = torch.linalg.solve(polar[torch.as_tensor(facets)], ones)
            return torch.as_tensor(self.origin) + corners

        return Shape(self.origin + corners, pulled_back, formula)

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`."""
        return self.shape(parameters.detach().numpy(), hull_of).attached(parameters)

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `Coordinates`: half-spaces that cut nothing stay, as they may cut again."""
        return parameters
