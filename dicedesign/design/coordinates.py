"""What a design varies: vertices, as in the paper, or facets, which stay flat by construction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dicedesign import kernels
from dicedesign.design.differentiable import RestEvaluation
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
    """

    points: Floats
    pulled_back: Callable[[Floats], Floats]

    def in_parameters(self, rows: Floats, source: Integers) -> Floats:
        """Gradients (r, p) in the parameters for those (r, 3 v) in some of the points, (v,) by
        number."""
        gradients = np.zeros((len(rows), *self.points.shape))
        gradients[:, source] = rows.reshape(len(rows), len(source), 3)
        return self.pulled_back(gradients)


class Coordinates(Protocol):
    """Parameters of a convex shape, as a flat array."""

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """The shape; `hull_of` makes the hulls that are needed on the way."""

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

        return Shape(self.origin + self.scale * parameters.reshape(-1, 3), pulled_back)

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
            if kernels.compiled is None:
                return _corner_gradients(normals, polar, facets, corners, rows)
            found: Floats = kernels.compiled.corner_gradients(
                normals, polar, facets.ravel(), corners, rows
            )
            return found

        return Shape(self.origin + corners, pulled_back)

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
