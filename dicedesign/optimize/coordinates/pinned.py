"""Facet coordinates of a shape some of whose facets stay in their planes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.geometry.hulls.hull import HullMaker, convex_hull
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.shape import Shape
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.rest_odds import RestEvaluation

__all__ = ["PinnedCoordinates"]


@dataclass(frozen=True, eq=False)
class PinnedCoordinates:
    """Normals and distances of all half-spaces but the pinned ones: parameters are the free ones of
    `FacetCoordinates`, in their order.

    Attributes
    ----------
    facets: coordinates of the whole shape.
    whole: (4 m,) its parameters, of which those of pinned facets stay.
    free: (n,) numbers of the others.
    """

    facets: FacetCoordinates
    whole: Floats
    free: Integers

    @classmethod
    def of(
        cls, points: Floats, origin: Floats, pinned: Floats, hull_of: HullMaker = convex_hull
    ) -> tuple[PinnedCoordinates, Floats]:
        """Coordinates about an origin (3,) inside, and the parameters of the hull of points (n, 3).

        pinned: (p, 3) unit directions; of each the facet stays whose normal is nearest.

        Raises DegenerateBodyError if the origin is not strictly inside.
        """
        facets, whole = FacetCoordinates.of(points, origin, hull_of)
        count = len(whole) // 4
        normals = whole[: 3 * count].reshape(count, 3)
        is_free = np.ones(count, dtype=bool)
        is_free[np.argmax(pinned @ normals.T, axis=1)] = False
        free = np.flatnonzero(np.concatenate([np.repeat(is_free, 3), is_free])).astype(np.int64)
        return cls(facets, whole, free), whole[free]

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `FacetCoordinates`."""
        moved = self.whole.copy()
        moved[self.free] = parameters
        shape = self.facets.shape(moved, hull_of)

        def pulled_back(gradients: Floats) -> Floats:
            return shape.pulled_back(gradients)[:, self.free]

        return Shape(shape.points, pulled_back)

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`; raises as `shape`, and InputError if these are no parameters."""
        import torch

        from dicedesign.gradient.body_function import double_tensor

        given = double_tensor(parameters, "parameters", len(self.free))
        moved = torch.from_numpy(self.whole).index_copy(0, torch.from_numpy(self.free), given)
        return self.facets.points(moved, hull_of).to(parameters)

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `FacetCoordinates`."""
        return parameters
