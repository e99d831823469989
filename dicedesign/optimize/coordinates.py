"""Coordinates of a design: parameters and the shapes that they make.

Parameters are vertices, as in the paper, or half-spaces, whose facets stay flat by construction.
Half-spaces can be independent, held, or linked.

A point group acts about the origin of space. An orbit is the set of facets that it maps onto each
other. A facet on a mirror plane or an axis of the group has its normal there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import ConvexHull, HullMaker, HullMemory, convex_hull
from dicedesign.geometry.point_groups import fixed_space
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.gradient.body_function import double_tensor, take_constant
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SYMMETRY_TOLERANCE


@dataclass(frozen=True)
class Shape:
    """Points whose hull is a shape, as a function of p parameters.

    Attributes
    ----------
    points: (n, 3).
    pull_back: converts gradients in the points (r, n, 3) to gradients in the parameters (r, p).
    """

    points: Floats
    pull_back: Callable[[Floats], Floats]

    def in_parameters(self, rows: Floats, source: Integers) -> Floats:
        """Convert gradients (r, 3 v) in points with numbers `source` (v,) to gradients (r, p) in
        the parameters."""
        gradients = np.zeros((len(rows), *self.points.shape))
        gradients[:, source] = rows.reshape(len(rows), len(source), 3)
        return self.pull_back(gradients)


class Coordinates(Protocol):
    """Parameters of a convex shape, as a flat array."""

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """Make the shape. hull_of: makes the hulls that this requires."""

    def prune(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """Remove parameters that the shape can never use again; the default keeps all."""
        return parameters


@dataclass(frozen=True)
class VertexCoordinates(Coordinates):
    """Vertices (n, 3), flattened, in units of `scale` from `origin`.

    Attributes
    ----------
    origin: (3,) position of the zero vector.
    scale: length of one unit.
    """

    origin: Floats
    scale: float

    @classmethod
    def of(cls, points: Floats, origin: Floats) -> tuple[VertexCoordinates, Floats]:
        """Coordinates about an origin (3,), and the parameters of the hull of points (n, 3)."""
        offsets = convex_hull(points).vertices - origin
        scale = float(np.abs(offsets).max())
        return cls(origin, scale), (offsets / scale).ravel()

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `Coordinates`."""
        points = self.origin + self.scale * parameters.reshape(-1, 3)
        return Shape(points, lambda rows: self.scale * rows.reshape(len(rows), points.size))

    def prune(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """Remove points that are not vertices of the hull."""
        return parameters.reshape(-1, 3)[rests.hull.source].ravel()


def normals_of(parameters: Any) -> Any:
    """Normals (m, 3) among parameters (4 m,) of `FacetCoordinates`, in NumPy or torch."""
    return parameters[: 3 * len(parameters) // 4].reshape(-1, 3)


@dataclass(frozen=True)
class FacetCoordinates(Coordinates):
    """Half-spaces `n_i . (x - origin) <= exp(l_i)`: m normals n_i of any length, then m values l_i.

    Half-spaces that cut nothing are kept, as they may cut later.

    Attributes
    ----------
    origin: (3,) a point inside the shape.
    """

    origin: Floats

    @classmethod
    def of(cls, points: Floats, origin: Floats) -> tuple[FacetCoordinates, Floats]:
        """Coordinates about an origin (3,) inside, and the parameters of the hull of points (n, 3).

        Raises DegenerateBodyError if the origin is not strictly inside.
        """
        hull = convex_hull(points)
        heights = hull.heights(origin)
        if (heights <= 0.0).any():
            raise DegenerateBodyError(
                f"facet coordinates: expected an origin inside the shape, got {origin.tolist()}; "
                "take its centroid"
            )
        return cls(origin), np.concatenate([hull.normals.ravel(), np.log(heights)])

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `Coordinates`. There is a corner for each triangle of the polar hull, where three
        planes meet. Raises DegenerateBodyError if the half-spaces bound no solid."""
        return self._shape_and_planes(parameters, hull_of)[0]

    def points(self, parameters: Tensor) -> Tensor:
        """Corners of the shape as a function of parameters (4 m,) in float32 or float64, for
        autograd and `torch.func`. If `torch.func.vmap` maps over shapes with different numbers of
        corners, unused rows repeat the first corner of a shape.

        Raises as `shape`, and InputError for parameters of another kind.
        """
        given = double_tensor(parameters, "parameters", "4 m")
        if len(given) % 4 != 0:
            raise InputError(
                f"parameters: expected three numbers of a normal and one of a distance for each of "
                f"m facets, got {len(given)}; pass all normals and then all distances"
            )

        def find(numbers: Floats) -> Integers:
            """Facets (*l, t, 3) that meet at the corners of shapes with parameters (*l, 4 m)."""
            rows = numbers.reshape(-1, numbers.shape[-1])
            planes = [self._shape_and_planes(row, convex_hull)[1] for row in rows]
            corners = np.arange(max(map(len, planes)))
            padded = [own[np.where(corners < len(own), corners, 0)] for own in planes]
            return np.reshape(padded, (*numbers.shape[:-1], len(corners), 3))

        corners = _corners(given, take_constant(find, given))
        return (torch.from_numpy(self.origin) + corners).to(parameters)

    def half_spaces(self, parameters: Floats) -> Floats:
        """(4 m,) parameters of all facets."""
        return parameters

    def _shape_and_planes(self, parameters: Floats, hull_of: HullMaker) -> tuple[Shape, Integers]:
        """Make the shape, and list the three facets (t, 3) that meet at each corner."""
        normals = normals_of(parameters)
        with np.errstate(all="ignore"):
            # The hull refuses numbers that are not finite.
            units = normals / norms(normals)[:, None]
            polar = units * np.exp(-parameters[normals.size :, None])
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

        def pull_back(gradients: Floats) -> Floats:
            rows = gradients.reshape(len(gradients), corners.size)
            pulled = kernels.corner_gradients(normals, polar, facets, corners, rows)
            return _corner_gradients(parameters, facets, rows) if pulled is None else pulled

        return Shape(self.origin + corners, pull_back), facets


def _corners(parameters: Tensor, facets: Tensor) -> Tensor:
    """Corners (t, 3) relative to the origin, where the planes of three facets (t, 3) meet."""
    normals = normals_of(parameters)
    units = normals / torch.linalg.vector_norm(normals, dim=1, keepdim=True)
    polar = units * torch.exp(-parameters[normals.numel() :, None])
    planes = polar[facets]
    return torch.linalg.solve(planes, torch.ones(planes.shape[:2], dtype=torch.float64))


def _corner_gradients(parameters: Floats, facets: Integers, rows: Floats) -> Floats:
    """Convert gradients (r, 3 t) in corners to gradients (r, 4 m) in parameters; see `_corners`."""
    with torch.enable_grad():
        leaf = torch.tensor(parameters, requires_grad=True)
        corners = _corners(leaf, torch.from_numpy(facets)).ravel()
        pulled = [
            torch.autograd.grad(corners, leaf, torch.from_numpy(row), retain_graph=True)[0].numpy()
            for row in rows
        ]
    return np.array(pulled).reshape(-1, len(parameters))


@dataclass(frozen=True, eq=False)
class LinkedCoordinates(Coordinates):
    """Half-spaces, some of which move together.

    Attributes
    ----------
    facets: coordinates of all m facets.
    expansion: (4 m, r) matrix from parameters (r,) to changes of the parameters of `facets`. Its
        columns are orthonormal, so that both changes have equal length.
    base: (4 m,) parameters of `facets` before any change.
    """

    facets: FacetCoordinates
    expansion: Floats
    base: Floats

    def half_spaces(self, parameters: Floats) -> Floats:
        """(4 m,) parameters of all facets."""
        moved: Floats = self.base + self.expansion @ parameters
        return moved

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `FacetCoordinates`."""
        shape = self.facets.shape(self.half_spaces(parameters), self._check(hull_of))
        return Shape(shape.points, lambda rows: shape.pull_back(rows) @ self.expansion)

    def points(self, parameters: Tensor) -> Tensor:
        """See `FacetCoordinates`."""
        given = double_tensor(parameters, "parameters", self.expansion.shape[1])
        moved = torch.from_numpy(self.base) + torch.from_numpy(self.expansion) @ given
        return self.facets.points(moved).to(parameters)

    def _check(self, hull_of: HullMaker) -> HullMaker:
        """Maker of polar hulls, which may refuse some."""
        return hull_of


def tie_coordinates(
    hull: ConvexHull, directions: Floats, angle: float
) -> tuple[FacetCoordinates | LinkedCoordinates, Floats]:
    """Coordinates of a hull about its centroid, and its parameters.

    Each facet is linked to the nearest of the facets with normals `directions` (k, 3) that is
    within an angle in radians. Parameters are then changes of the normals and of the logarithms of
    the distances. Without linked facets these are facet coordinates.
    """
    facets, whole = FacetCoordinates.of(hull.vertices, hull.centroid)
    normals = normals_of(whole)
    leaders = np.argmax(normals @ directions.T, axis=0)
    cosines = normals @ normals[leaders].T
    nearest = leaders[np.argmax(cosines, axis=1)]
    group = np.where(cosines.max(axis=1) > np.cos(angle), nearest, np.arange(len(normals)))
    # A leader is nearest to itself; rounding may say otherwise.
    group[leaders] = leaders
    members = (group[:, None] == np.unique(group)).astype(np.float64)
    if members.shape[1] == len(normals):
        return facets, whole
    members /= np.sqrt(members.sum(axis=0))
    normals_part = np.kron(members, np.eye(3))
    expansion = np.zeros((len(whole), 4 * members.shape[1]))
    expansion[: len(normals_part), : normals_part.shape[1]] = normals_part
    expansion[len(normals_part) :, normals_part.shape[1] :] = members
    return LinkedCoordinates(facets, expansion, whole), np.zeros(expansion.shape[1])


@dataclass(frozen=True, eq=False)
class SymmetricCoordinates(LinkedCoordinates):
    """Parameters of one facet for each orbit: the free components of the normals, orbit by orbit,
    followed by the logarithms of the distances.

    Attributes
    ----------
    orbits: (m,) number of the orbit of each facet.
    """

    orbits: Integers

    @classmethod
    def of(
        cls, points: Floats, origin: Floats, group: Floats
    ) -> tuple[SymmetricCoordinates, Floats]:
        """Coordinates about the fixed point of the group (g, 3, 3) that is nearest to an origin
        (3,), and the parameters of the nearest exactly symmetric shape to the hull of points (n,
        3).

        Raises
        ------
        InputError: the group does not map the hull onto itself.
        DegenerateBodyError: the fixed point is not strictly inside.
        """
        facets, parameters = FacetCoordinates.of(points, fixed_space(group) @ origin)
        normals = normals_of(parameters)
        count, logarithms = len(normals), parameters[normals.size :]
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
        firsts, orbits = np.unique(images.min(axis=0), return_inverse=True)
        columns = []
        scales = np.zeros((4 * count, len(firsts)))
        for number, first in enumerate(firsts):
            members = np.flatnonzero(orbits == number)
            length = np.sqrt(len(members))
            carriers = group[np.argmax(images[:, [first]] == members, axis=0)]
            free = _range_basis(fixed_space(group[images[:, first] == first]))
            column = np.zeros((4 * count, free.shape[1]))
            column[3 * members[:, None] + np.arange(3)] = carriers @ (free / length)
            columns.append(column)
            scales[3 * count + members, number] = 1.0 / length
        expansion = np.hstack([*columns, scales])
        base = np.zeros(4 * count)
        return cls(facets, expansion, base, orbits.astype(np.int64)), expansion.T @ parameters

    def _check(self, hull_of: HullMaker) -> HullMaker:
        """Hull maker that raises DegenerateBodyError if, by rounding, only some facets of an orbit
        bound the solid."""

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


def coordinates_of(
    points: Floats, origin: Floats, group: Floats | None
) -> tuple[Coordinates, Floats]:
    """Facet coordinates of the hull of points (n, 3) about an origin (3,), and its parameters.

    group: (g, 3, 3) point group to keep, or None.
    """
    if group is not None:
        return SymmetricCoordinates.of(points, origin, group)
    return FacetCoordinates.of(points, origin)


def orbits_of_directions(directions: Floats, group: Floats) -> Integers:
    """Number (k,) of the orbit of each direction (k, 3), from 0 in the order of first members.

    Raises InputError if an element of the group (g, 3, 3) does not permute the directions.
    """
    first = images_of_directions(directions, group).min(axis=0)
    return np.unique(first, return_inverse=True)[1].astype(np.int64)


def images_of_directions(directions: Floats, group: Floats) -> Integers:
    """Number (g, k) of the direction onto which each element of a group (g, 3, 3) maps each
    direction (k, 3) of any length.

    Raises InputError if an element does not permute the directions.
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


@dataclass
class ShapeEvaluator:
    """Evaluates the rests of shapes. It remembers the last hulls, and counts its work.

    Attributes
    ----------
    center_of_mass: (3,) fixed, or None for the centroid of the uniform solid.
    offset: (3,) of the center of mass from that centroid, if it is not fixed.
    evaluations: number of shapes.
    shapes, polars: last hulls of shapes, and of the polar bodies that coordinates require.
    """

    center_of_mass: Floats | None
    offset: Floats | None = None
    evaluations: int = 0
    shapes: HullMemory = field(default_factory=HullMemory)
    polars: HullMemory = field(default_factory=HullMemory)

    def evaluate(
        self, coordinates: Coordinates, parameters: Floats
    ) -> tuple[Shape, RestEvaluation]:
        """Make a shape and evaluate its rests. Raises DiceError if it is no solid with the center
        of mass inside."""
        self.evaluations += 1
        given = self.center_of_mass
        shape = coordinates.shape(parameters, self.polars.hull)
        points = torch.from_numpy(shape.points).requires_grad_()
        center = None if given is None else torch.as_tensor(given)
        return shape, evaluate_rests(points, center, self.shapes.hull, self.offset)

    @property
    def hulls_built(self) -> int:
        """Hulls that were computed from scratch."""
        return self.shapes.built + self.polars.built

    @property
    def hulls_reused(self) -> int:
        """Hulls that have the connectivity of the one before."""
        return self.shapes.reused + self.polars.reused
