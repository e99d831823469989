"""Parameters of a design, and the shapes that they make: vertices, as in the paper, or half-spaces,
whose facets stay flat by construction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import HullMaker, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.gradient.body_function import BodyFunction, double_tensor, seen
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.rest_odds import RestEvaluation


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

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """The points of the shape as a function of a tensor, for autograd and `torch.func`, of
        parameters (p,) as float32 or float64."""

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
