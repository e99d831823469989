"""The vertices of a shape as what a design varies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import HullMaker, convex_hull
from dicedesign.optimize.coordinates.shape import Shape
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.rest_odds import RestEvaluation

__all__ = ["VertexCoordinates"]


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

        return Shape(self.origin + self.scale * parameters.reshape(-1, 3), pulled_back)

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`. Raises InputError if these are no parameters."""
        import torch

        from dicedesign.gradient.body_function import double_tensor

        given = double_tensor(parameters, "parameters", "3 n")
        if len(given) % 3 != 0:
            raise InputError(
                f"parameters: expected three numbers for each of n points, got {len(given)}; pass "
                "all of one point and then all of the next"
            )
        points = torch.from_numpy(self.origin) + self.scale * given.reshape(-1, 3)
        return points.to(parameters)

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `Coordinates`: drops points that are no vertices of the hull."""
        return parameters.reshape(-1, 3)[rests.hull.source].ravel()
