"""Half-spaces as what a design varies: the shape is their intersection."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import HullMaker, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.kernels import ops as kernels
from dicedesign.optimize.coordinates.shape import Shape
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.rest_odds import RestEvaluation

__all__ = ["FacetCoordinates"]


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
        return self._shape_and_planes(parameters, hull_of)[0]

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`. Raises InputError if these are no parameters, and as `shape`."""
        from dicedesign.optimize.coordinates.corner_tensors import corner_points

        made = partial(self._shape_and_planes, hull_of=hull_of)
        return corner_points(parameters, self.origin, made)

    def _shape_and_planes(
        self, parameters: Floats, hull_of: HullMaker = convex_hull
    ) -> tuple[Shape, Integers]:
        """The shape, and (t, 3) the facets whose planes meet at each corner."""
        count = len(parameters) // 4
        normals = parameters[: 3 * count].reshape(count, 3)
        with np.errstate(all="ignore"):
            # A hull tells what is no number.
            units, inverse = normals / norms(normals)[:, None], np.exp(-parameters[3 * count :])
            polar = units * inverse[:, None]
        hull = hull_of(polar)
        if (hull.heights(np.zeros(3)) <= 0.0).any():
            raise DegenerateBodyError(
                "facet coordinates: expected half-spaces that bound a solid, got normals that "
                "leave a direction open; take a smaller step"
            )
        facets = hull.source[hull.triangles]
        planes = polar[facets]
        solved = np.linalg.solve(planes, np.ones((len(planes), 3, 1)))
        corners = np.asarray(solved[..., 0], dtype=np.float64)

        def pulled_back(gradients: Floats) -> Floats:
            rows = gradients.reshape(len(gradients), corners.size)
            pulled = kernels.corner_gradients(normals, polar, facets, corners, rows)
            if pulled is None:
                return _corner_gradients(normals, polar, facets, corners, rows)
            return pulled

        return Shape(self.origin + corners, pulled_back), facets

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `Coordinates`: half-spaces that cut nothing stay, as they may cut again."""
        return parameters


def _corner_gradients(
    normals: Floats, polar: Floats, facets: Integers, corners: Floats, rows: Floats
) -> Floats:
    """Gradients (r, 4 m) in normals (m, 3) and logarithms of distances for those (r, 3 t) in
    corners (t, 3), each where the planes of three facets (t, 3) meet; polar: (m, 3) points."""
    # Of the solution of three equations, in each of them.
    right = rows.T.reshape(len(corners), 3, len(rows))
    shares = np.linalg.solve(np.swapaxes(polar[facets], 1, 2), right)
    by_plane = -shares[:, :, None, :] * corners[:, None, :, None]
    by_polar = np.zeros((*polar.shape, len(rows)))
    np.add.at(by_polar, facets, by_plane)
    sizes, inverse = norms(normals), norms(polar)
    units = normals / sizes[:, None]
    along = (units[..., None] * by_polar).sum(axis=1)
    across = by_polar - units[..., None] * along[:, None]
    across *= (inverse / sizes)[:, None, None]
    by_logarithm = -inverse[:, None] * along
    return np.concatenate([across.reshape(normals.size, len(rows)), by_logarithm]).T
