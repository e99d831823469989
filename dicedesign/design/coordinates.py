"""What a design varies: vertices, as in the paper, or facets, which stay flat by construction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.design.differentiable import RestEvaluation
from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hull import convex_hull
from dicedesign.geometry.hull_reuse import HullMaker

__all__ = ["Coordinates", "FacetCoordinates", "VertexCoordinates"]

Floats = NDArray[np.float64]


class Coordinates(Protocol):
    """Parameters of a convex shape, as a flat array."""

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """(n, 3) points, differentiable in the parameters, whose hull is the shape; `hull_of` makes
        the hulls that are needed on the way."""

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

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`."""
        return torch.as_tensor(self.origin) + self.scale * parameters.reshape(-1, 3)

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

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`: one corner for each triangle of the polar hull, from the three planes
        that meet there. Raises DegenerateBodyError if the half-spaces bound no solid."""
        count = parameters.shape[0] // 4
        normals = parameters[: 3 * count].reshape(count, 3)
        lengths = torch.linalg.vector_norm(normals, dim=1) * torch.exp(parameters[3 * count :])
        polar = normals / lengths[:, None]
        hull = hull_of(polar.detach().numpy())
        if (hull.heights(np.zeros(3)) <= 0.0).any():
            raise DegenerateBodyError(
                "facet coordinates: expected half-spaces that bound a solid, got normals that "
                "leave a direction open; take a smaller step"
            )
        planes = polar[torch.as_tensor(hull.source[hull.triangles])]
        ones = torch.ones(len(planes), 3, dtype=torch.float64)
        return torch.as_tensor(self.origin) + torch.linalg.solve(planes, ones)

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `Coordinates`: half-spaces that cut nothing stay, as they may cut again."""
        return parameters
