"""Facet coordinates of which some are held or move together: facets that stay in their planes,
those that lie almost in one plane, and images of each other under a point group.

A point group acts about the origin of space; an orbit is the set of facets that it carries to each
other. A facet on a mirror plane or an axis of the group has its normal there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import ConvexHull, HullMaker, convex_hull
from dicedesign.geometry.point_groups import fixed_space
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.optimize.coordinates.facets import FacetCoordinates, Shape
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SYMMETRY_TOLERANCE

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.rest_odds import RestEvaluation


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


@dataclass(frozen=True)
class TiedCoordinates:
    """Parameters are changes of the normals and of the logarithms of the distances, shared by the
    facets of a group.

    Attributes
    ----------
    facets: coordinates of all m facets. whole: (4 m,) their parameters before any change.
    expansion: (4 m, r) with orthonormal columns, from the parameters (r,) to the changes.
    """

    facets: FacetCoordinates
    whole: Floats
    expansion: Floats

    @classmethod
    def of(
        cls, hull: ConvexHull, directions: Floats, angle: float
    ) -> tuple[FacetCoordinates | TiedCoordinates, Floats]:
        """Coordinates about the centroid of a hull, and its parameters.

        Each facet is tied to the nearest of those with normals `directions` (k, 3), if that is
        within an angle in radians. Where there is nothing to tie, these are facet coordinates.
        """
        facets, whole = FacetCoordinates.of(hull.vertices, hull.centroid)
        normals = whole[: 3 * len(whole) // 4].reshape(-1, 3)
        leaders = np.argmax(normals @ directions.T, axis=0)
        cosines = normals @ normals[leaders].T
        nearest = leaders[np.argmax(cosines, axis=1)]
        group = np.where(cosines.max(axis=1) > np.cos(angle), nearest, np.arange(len(normals)))
        # A leader is nearest to itself, but for rounding.
        group[leaders] = leaders
        members = (group[:, None] == np.unique(group)).astype(np.float64)
        if members.shape[1] == len(normals):
            return facets, whole
        members /= np.sqrt(members.sum(axis=0))
        normals_part = np.kron(members, np.eye(3))
        expansion = np.zeros((len(whole), 4 * members.shape[1]))
        expansion[: len(normals_part), : normals_part.shape[1]] = normals_part
        expansion[len(normals_part) :, normals_part.shape[1] :] = members
        return cls(facets, whole, expansion), np.zeros(expansion.shape[1])

    def half_spaces(self, parameters: Floats) -> Floats:
        """(4 m,) parameters of all facets."""
        moved: Floats = self.whole + self.expansion @ parameters
        return moved

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `FacetCoordinates`."""
        shape = self.facets.shape(self.half_spaces(parameters), hull_of)
        return Shape(shape.points, lambda rows: shape.pulled_back(rows) @ self.expansion)

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`."""
        import torch

        moved = torch.from_numpy(self.whole) + torch.from_numpy(self.expansion) @ parameters
        return self.facets.points(moved, hull_of)

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `FacetCoordinates`."""
        return parameters


@dataclass(frozen=True)
class SymmetricCoordinates:
    """Parameters of one facet for each orbit: the free components of the normals, orbit by orbit,
    followed by the logarithms of the distances, both in units that make steps of the parameters as
    long as those of all facets together.

    Attributes
    ----------
    facets: coordinates of all m facets.
    expansion: (4 m, r) with orthonormal columns; times the parameters (r,) it gives those of
        `facets`.
    orbits: (m,) number of the orbit of each facet.
    """

    facets: FacetCoordinates
    expansion: Floats
    orbits: Integers

    @classmethod
    def of(
        cls, points: Floats, origin: Floats, group: Floats, hull_of: HullMaker = convex_hull
    ) -> tuple[SymmetricCoordinates, Floats]:
        """Coordinates about the position nearest to an origin (3,) that the group (g, 3, 3) keeps,
        and the parameters of the hull of points (n, 3), or of the nearest that is symmetric to the
        last bit.

        Raises
        ------
        InputError: the group does not map the hull onto itself.
        DegenerateBodyError: that position is not strictly inside.
        """
        facets, parameters = FacetCoordinates.of(points, fixed_space(group) @ origin, hull_of)
        count = len(parameters) // 4
        normals, logarithms = parameters[: 3 * count].reshape(count, 3), parameters[3 * count :]
        images = images_of_directions(normals, group)
        gaps = np.abs(logarithms[images] - logarithms)
        if not gaps.max() <= SYMMETRY_TOLERANCE:
            element, facet = np.unravel_index(np.argmax(gaps), gaps.shape)
            raise InputError(
                f"symmetry: expected facet {facet} and its image under element {element} of the "
                f"point group at the same distance from {facets.origin.tolist()}, got a ratio of "
                f"{np.exp(gaps.max()):.6g}; center the shape at the origin with its main axis "
                "along z, or take a smaller group"
            )
        orbits = images.min(axis=0)
        columns, scales = [], []
        for first in np.unique(orbits):
            members = np.flatnonzero(orbits == first)
            length = np.sqrt(len(members))
            carriers = group[np.argmax(images[:, [first]] == members, axis=0)]
            free = _range_basis(fixed_space(group[images[:, first] == first]))
            column = np.zeros((4 * count, free.shape[1]))
            rows = 3 * members[:, None] + np.arange(3)
            column[rows] = carriers @ (free / length)
            columns.append(column)
            scale = np.zeros((4 * count, 1))
            scale[3 * count + members] = 1.0 / length
            scales.append(scale)
        expansion = np.hstack([*columns, *scales])
        numbers = np.unique(orbits, return_inverse=True)[1].astype(np.int64)
        return cls(facets, expansion, numbers), expansion.T @ parameters

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `FacetCoordinates`. Raises DegenerateBodyError also where rounding lets only some of
        an orbit's facets bound the solid."""
        whole = self.facets.shape(self.expansion @ parameters, self._whole_orbits(hull_of))

        def pulled_back(gradients: Floats) -> Floats:
            return whole.pulled_back(gradients) @ self.expansion

        return Shape(whole.points, pulled_back)

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`; raises as `shape`, and InputError if these are no parameters."""
        import torch

        from dicedesign.gradient.body_function import double_tensor

        given = double_tensor(parameters, "parameters", self.expansion.shape[1])
        whole = torch.from_numpy(self.expansion) @ given
        return self.facets.points(whole, self._whole_orbits(hull_of)).to(parameters)

    def _whole_orbits(self, hull_of: HullMaker) -> HullMaker:
        """The polar hulls that `hull_of` makes, of which all facets of an orbit are corners or
        none."""

        def whole(polar: Floats) -> ConvexHull:
            hull = hull_of(polar)
            sizes = np.bincount(self.orbits)
            bounding = np.bincount(self.orbits[hull.source], minlength=len(sizes))
            if (bounding % sizes != 0).any():
                raise DegenerateBodyError(
                    f"symmetry: expected all facets of an orbit or none to bound the solid, got "
                    f"{bounding.tolist()} of {sizes.tolist()} facets of the orbits; "
                    "take a smaller step"
                )
            return hull

        return whole

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `FacetCoordinates`."""
        return parameters


def orbits_of_directions(directions: Floats, group: Floats) -> Integers:
    """(k,) number of the orbit of each of some directions (k, 3), from 0 in the order in which the
    orbits' first members come.

    Raises InputError where an element of the group (g, 3, 3) does not permute them.
    """
    first = images_of_directions(directions, group).min(axis=0)
    return np.unique(first, return_inverse=True)[1].astype(np.int64)


def images_of_directions(directions: Floats, group: Floats) -> Integers:
    """(g, k) number of the direction onto which each element of a group (g, 3, 3) maps each of some
    directions (k, 3), which need not be unit vectors.

    Raises InputError where an element does not permute them.
    """
    units = unit_vectors(directions)
    turned = np.einsum("gij,kj->gki", group, units)
    images = np.argmax(turned @ units.T, axis=-1)
    gaps = norms(turned - units[images])
    if not gaps.max() <= SYMMETRY_TOLERANCE:
        element, number = np.unravel_index(np.argmax(gaps), gaps.shape)
        raise InputError(
            f"symmetry: expected directions that the point group maps onto each other, got "
            f"{np.round(units[number], 6).tolist()}, whose image under element {element} is "
            f"{gaps.max():.3g} from the nearest unit vector; turn the shape's main axis to z and "
            "center it at the origin, or take a smaller group"
        )
    repeated = np.diff(np.sort(images, axis=1), axis=1) == 0
    if repeated.any():
        element, place = np.argwhere(repeated)[0]
        number = np.sort(images[element])[place]
        raise InputError(
            f"symmetry: expected directions that the point group permutes, got two that element "
            f"{element} maps onto {np.round(units[number], 6).tolist()}; remove facets that nearly "
            "coincide"
        )
    return images.astype(np.int64)


def _range_basis(projection: Floats) -> Floats:
    """(3, d) orthonormal columns that span the range of an orthogonal projection (3, 3) of rank
    d, along the coordinate axes where it contains them."""
    columns: list[Floats] = []
    remaining = projection
    for _ in range(round(float(np.trace(projection)))):
        longest = remaining[:, np.argmax(np.diag(remaining))]
        columns.append(longest / np.linalg.norm(longest))
        remaining = remaining - np.outer(columns[-1], columns[-1])
    return np.stack(columns, axis=1)
