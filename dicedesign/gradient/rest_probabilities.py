"""Resting probabilities as differentiable functions of vertices and center of mass.

The values come from the forward model in `dicedesign.rest`, and so do the combinatorics: which
facets are stable, and which edges each separatrix crosses. Gradients are exact as long as these do
not change. Compiled kernels sweep back along each separatrix, or torch evaluates the formulas of
the forward model again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, HullMaker, convex_hull
from dicedesign.geometry.sphere import foot_on_line, norms
from dicedesign.geometry.triangles import second_moments, stretch_matrix, volume_and_centroid
from dicedesign.gradient.body_function import (
    adjoint_function,
    double_tensor,
    take_constant,
    uncompiled,
)
from dicedesign.kernels import ops as kernels
from dicedesign.rest.basins import Basins, basin_areas, close_areas, tie_distance
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.morse import (
    Separatrices,
    basin_references,
    border_areas,
    separatrices,
    separatrix_points,
)
from dicedesign.runtime.arrays import Floats, Integers, ragged_ranges


def hull_centroid(vertices: Tensor, hull: ConvexHull) -> Tensor:
    """Center of mass (3,) of the uniform solid hull as a function of its vertices (n, 3)."""
    return adjoint_function(
        hull.centroid,
        lambda gradient: (centroid_gradient(hull, gradient),),
        lambda vertices: _centroid(vertices, hull.triangles),
        vertices,
    )


def centroid_gradient(hull: ConvexHull, gradient: Floats) -> Floats:
    """Gradient (n, 3) in the vertices from the gradient (3,) in the center of mass of the uniform
    solid hull."""
    by_vertices = kernels.centroid_gradient(hull, gradient)
    if by_vertices is kernels.UNDECIDED:
        leaf = torch.tensor(hull.vertices, requires_grad=True)
        with torch.enable_grad():
            along = _centroid(leaf, hull.triangles) @ torch.as_tensor(gradient)
        by_vertices = torch.autograd.grad(along, leaf)[0].numpy()
    return by_vertices


def _centroid(vertices: Tensor, triangles: Integers) -> Tensor:
    """Centroid (3,) of a hull. Needles and plates are stretched first (`stretch_matrix`), by a
    constant matrix, as that changes only rounding."""
    origin = vertices.detach().mean(dim=0)
    offsets = vertices - origin
    volume, centroid = volume_and_centroid(offsets, triangles, torch)
    stretch = stretch_matrix(offsets.detach().numpy(), volume.item())
    if stretch is not None:
        matrix = torch.as_tensor(stretch)
        image = torch.linalg.solve(matrix, offsets, left=False)
        centroid = volume_and_centroid(image, triangles, torch)[1] @ matrix
    return origin + centroid


def hull_inertia(vertices: Tensor, hull: ConvexHull) -> Tensor:
    """Tensor of inertia (3, 3) of the uniform solid hull about its centroid, over its mass, as a
    function of the vertices (n, 3); see `dicedesign.geometry.triangles.Surface`."""
    centroid = _centroid(vertices, hull.triangles)
    moments, volume = second_moments(vertices - centroid, hull.triangles, torch)
    moments = moments / volume
    return moments.trace() * torch.eye(3, dtype=vertices.dtype) - moments


@dataclass(frozen=True)
class RestEvaluation:
    """Rests of a hull, with coordinates in torch. Everything is computed on first use.

    Attributes
    ----------
    equilibria: the classified hull.
    vertices: (n, 3) vertices of the hull as a tensor.
    given_center: (3,) center of mass as a tensor, or None for that of the uniform solid.
    basins: basins of the body, if they are known.
    offset: (3,) of the center of mass from that of the uniform solid, if it is not given.
    """

    equilibria: Equilibria
    vertices: Tensor
    given_center: Tensor | None = None
    basins: Basins | None = None
    offset: Floats | None = None

    @cached_property
    def center_of_mass(self) -> Tensor:
        """(3,) the center of mass."""
        return self.center_of(self.vertices)

    def center_of(self, vertices: Tensor) -> Tensor:
        """(3,) the center of mass of the hull with other vertices (n, 3)."""
        if self.given_center is not None:
            return self.given_center
        centroid = hull_centroid(vertices, self.hull)
        return centroid if self.offset is None else centroid + torch.as_tensor(self.offset)

    @property
    def hull(self) -> ConvexHull:
        """The hull, as numbers."""
        return self.equilibria.hull

    def raise_ties(self) -> RestEvaluation:
        """Copy that raises `Tie` on first use if the body is tied (see `find_basins`)."""
        equilibria = self.equilibria
        distance = tie_distance(equilibria.hull, equilibria.center_of_mass)
        return replace(self, equilibria=replace(equilibria, tie_distance=distance))

    @cached_property
    def paths(self) -> Separatrices:
        """Separatrices that divide basins; rests are numbered as in `paths.rests`."""
        return separatrices(self.equilibria) if self.basins is None else self.basins.paths

    @cached_property
    def probability_values(self) -> Floats:
        """(k,) probabilities of the rests as numbers (eq. 9, 10).

        Raises DegenerateBodyError if the basins do not close, like `rest_poses`.
        """
        basins = self.basins
        areas = basin_areas(self.equilibria, self.paths) if basins is None else basins.areas
        return areas / (4.0 * np.pi)

    @cached_property
    def probabilities(self) -> Tensor:
        """(k,) probabilities of the rests as a tensor with gradients (eq. 9, 10)."""
        hull, paths, center = self.hull, self.paths, self.equilibria.center_of_mass
        return self.function(
            self.probability_values,
            lambda slopes: kernels.area_gradient(hull, paths, center, slopes / (4.0 * np.pi)),
            partial(rest_probabilities, hull, paths),
        )

    def function(
        self,
        value: Floats | None,
        gradient: Callable[[Floats], tuple[Floats, ...] | None],
        formula: Callable[..., Tensor],
        *others: Tensor,
    ) -> Tensor:
        """A function of the vertices, the center of mass and other tensors, as a tensor.

        value: its numbers, or None if the formula is to compute them; gradient: from gradients in
            these numbers to gradients in the vertices (n, 3), in the center (3,) and in the others,
            or None if torch is to compute them; formula: the function by operations of torch.
        """
        if self.given_center is not None:
            inputs = self.vertices, self.given_center, *others
            return adjoint_function(value, gradient, formula, *inputs)
        # The graph must not hold this evaluation, which may hold the tensor.
        bare = replace(self)

        def adjoint(slopes: Floats) -> tuple[Floats, ...] | None:
            parts = gradient(slopes)
            return parts and (bare.with_center(*parts[:2]), *parts[2:])

        def of_vertices(vertices: Tensor, *others: Tensor) -> Tensor:
            return formula(vertices, bare.center_of(vertices), *others)

        return adjoint_function(value, adjoint, of_vertices, self.vertices, *others)

    def with_center(self, by_vertices: Floats, by_center: Floats) -> Floats:
        """Total gradient (n, 3) in the vertices, from gradients in the vertices (n, 3) and in the
        center of mass (3,): the center of a uniform solid moves with the vertices."""
        if self.given_center is not None:
            return by_vertices
        return by_vertices + centroid_gradient(self.hull, by_center)

    def rows_with_center(self, by_vertices: Floats, by_center: Floats) -> Floats:
        """Total gradients (r, 3 n) of r functions in the vertices, from gradients in the vertices
        (r, 3 n) and in the center of mass (r, 3); see `with_center`."""
        if self.given_center is not None:
            return by_vertices
        by_axis = [centroid_gradient(self.hull, axis).ravel() for axis in np.eye(3)]
        return by_vertices + by_center @ np.stack(by_axis)

    @property
    def jacobian(self) -> Floats:
        """(k, 3 n) Jacobian of the probabilities in the vertices; the center of mass of a uniform
        solid moves with these."""
        rows = kernels.area_jacobian(self.hull, self.paths, self.equilibria.center_of_mass)
        if rows is kernels.UNDECIDED:
            return self.jacobian_of(lambda rests: rests.probabilities)
        return self.rows_with_center(*rows) / (4.0 * np.pi)

    def jacobian_of(self, function: Callable[[RestEvaluation], Tensor]) -> Floats:
        """(k, 3 n) Jacobian in the vertices of a function from evaluations to tensors (k,), by
        torch, row by row."""
        vertices = self.vertices.detach().requires_grad_()
        with torch.enable_grad():
            values = function(replace(self, vertices=vertices))
        rows = [torch.autograd.grad(value, vertices, retain_graph=True)[0] for value in values]
        return torch.stack(rows).flatten(1).numpy()

    def facet_normals(self, facets: Integers) -> Tensor:
        """(len(facets), 3) unit normals of facets."""
        hull = self.hull

        def adjoint(slopes: Floats) -> tuple[Floats] | None:
            by_vertices = kernels.normal_gradient(hull, facets, slopes)
            return None if by_vertices is kernels.UNDECIDED else (by_vertices,)

        formula = partial(facet_normals, hull, facets)
        return adjoint_function(hull.normals[facets], adjoint, formula, self.vertices)

    @cached_property
    def rest_normals(self) -> Tensor:
        """(k, 3) unit normals of the stable facets."""
        return self.facet_normals(self.paths.rests)

    @cached_property
    def facet_areas(self) -> Tensor:
        """(m,) areas of the facets, by the triangles they are cut into."""
        hull = self.hull
        a, b, c = (self.vertices[corner] for corner in hull.triangles.T)
        owner = np.repeat(np.arange(len(hull.normals)), np.diff(hull.facet_start) - 2)
        vectors = torch.zeros((len(hull.normals), 3), dtype=torch.float64)
        vectors = vectors.index_add(0, torch.as_tensor(owner), torch.linalg.cross(b - a, c - a))
        return torch.linalg.vector_norm(vectors, dim=1) / 2.0

    @cached_property
    def facet_depths(self) -> Tensor:
        """(m,) signed distances of the foot of the center of mass on each facet from the line of
        the nearest edge, over the circumscribed radius; positive inside, that is for rests."""
        hull, center = self.hull, self.equilibria.center_of_mass
        return self.function(
            kernels.facet_depths(hull, center),
            partial(kernels.depth_gradient, hull, center),
            partial(facet_depths, hull),
        )

    @property
    def depths(self) -> Floats:
        """(m,) facet depths as numbers."""
        hull, center = self.hull, self.equilibria.center_of_mass
        depths = kernels.facet_depths(hull, center)
        if depths is not kernels.UNDECIDED:
            return depths
        # In NumPy, as transforms of `torch.func` hide the numbers of tensors.
        return hull.foot_depths(center) / norms(hull.vertices - center).max()

    @property
    def facets(self) -> Integers:
        """(k,) facet of each rest."""
        return self.paths.rests

    @property
    def saddles(self) -> Tensor:
        """(s, 3) unit directions from the center of mass to the saddles that divide basins; saddle
        i is between the rests `paths.basins[i]`."""
        return torch.nn.functional.normalize(self.saddle_directions, dim=1)

    @property
    def maxima(self) -> Tensor:
        """(2 s, 3) unit directions from the center of mass to the maxima: numbers 2 i and 2 i + 1
        are at the ends of the separatrices from saddle i."""
        return self.vertex_directions(self.paths.maxima)

    @property
    def saddle_directions(self) -> Tensor:
        """(s, 3) directions, not normalized, from the center of mass to the saddles of `paths`
        (eq. 7, 8)."""
        tail, head = (self.vertices[ends] for ends in self.paths.saddle_ends.T)
        return foot_on_line(
            tail - self.center_of_mass, head - self.center_of_mass, head - tail, torch
        )

    def vertex_directions(self, vertices: Integers) -> Tensor:
        """(len(vertices), 3) unit directions from the center of mass to vertices (eq. 6)."""
        radii = self.vertices[vertices] - self.center_of_mass
        return radii / torch.linalg.vector_norm(radii, dim=1, keepdim=True)


@uncompiled
def evaluate_rests(
    points: Tensor,
    center_of_mass: Tensor | None = None,
    hull_of: HullMaker | None = None,
    offset: Floats | None = None,
) -> RestEvaluation:
    """Hull and rests of points, computed in float64 on the CPU. Rests are in the order of facets.

    Parameters
    ----------
    points: (n, 3) float32 or float64; float32 points count as rounded ones, see `convex_hull`.
    center_of_mass: (3,) float32 or float64, or None for that of the uniform solid hull.
    hull_of: makes the hull.
    offset: (3,) of the center of mass from that of the uniform solid hull, if it is not given.

    Raises
    ------
    InputError: an input is no such tensor, or `torch.func.vmap` maps over it, as numbers of rests
        differ.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.
    """
    given = double_tensor(points, "vertices", "n", 3)
    center = None
    if center_of_mass is not None:
        center = double_tensor(center_of_mass, "center of mass", 3)
    make = hull_of or partial(convex_hull, single_precision=points.dtype == torch.float32)
    classified: list[Equilibria] = []

    def find(numbers: Floats, *middle: Floats) -> Integers:
        if numbers.ndim > 2:
            raise InputError(
                f"vertices: expected one body, got {len(numbers)} that vmap maps over; take "
                "differentiable_rest, or one body after the other"
            )
        hull = make(numbers)
        own = hull.centroid if offset is None else hull.centroid + offset
        classified.append(classify(hull, middle[0] if middle else own))
        return np.zeros((), dtype=np.int64)

    take_constant(find, *((given,) if center is None else (given, center)))
    hull = classified[0].hull
    if len(hull.source) < len(given):
        given = given[torch.as_tensor(hull.source)]
    return RestEvaluation(classified[0], given, center, offset=offset)


def rest_probabilities(
    hull: ConvexHull, paths: Separatrices, vertices: Tensor, center: Tensor
) -> Tensor:
    """(k,) probabilities of the rests, by the formulas of the forward model (eq. 9, 10).

    paths: separatrices that divide basins; vertices: (n, 3); center: (3,) center of mass.
    """
    count = len(paths.rests)
    if count == 1:
        return torch.ones(1, dtype=torch.float64) + 0.0 * (vertices.sum() + center.sum())
    points = separatrix_points(paths, vertices, center, torch)
    # A closed loop's area does not depend on the reference direction: no gradient there.
    normals = hull.normals[paths.rests]
    reference = torch.as_tensor(basin_references(paths, points.detach().numpy(), normals))
    border = border_areas(paths, points, reference, torch)
    basins = torch.as_tensor(paths.basins.ravel())
    areas = torch.zeros(count, dtype=torch.float64).index_add(0, basins, border.reshape(-1))
    signed = areas.detach().numpy()
    areas = areas + torch.as_tensor(close_areas(signed) - signed)
    return areas / (4.0 * torch.pi)


def facet_normals(hull: ConvexHull, facets: Integers, vertices: Tensor) -> Tensor:
    """(len(facets), 3) unit normals of facets, from the area vectors of their polygons."""
    start = hull.facet_start[facets]
    owner, half_edges = ragged_ranges(start, hull.facet_start[facets + 1] - start)
    anchor = vertices[hull.tail[start]][owner]
    a = vertices[hull.tail[half_edges]] - anchor
    b = vertices[hull.head[half_edges]] - anchor
    vectors = torch.zeros((len(facets), 3), dtype=torch.float64)
    vectors = vectors.index_add(0, torch.as_tensor(owner), torch.linalg.cross(a, b))
    return vectors / torch.linalg.vector_norm(vectors, dim=1, keepdim=True)


def facet_depths(hull: ConvexHull, vertices: Tensor, center: Tensor) -> Tensor:
    """(m,) depths of the facets, see `RestEvaluation.facet_depths`."""
    normals = facet_normals(hull, np.arange(len(hull.normals)), vertices)
    edges = vertices[hull.head] - vertices[hull.tail]
    radii = vertices - center
    circumscribed = torch.linalg.vector_norm(radii, dim=1).max()
    across = torch.linalg.cross(edges, normals[hull.facet])
    length = torch.linalg.vector_norm(edges, dim=1)
    distance = (radii[hull.tail] * across).sum(-1) / (length * circumscribed)
    far = torch.full((len(hull.normals),), torch.inf, dtype=torch.float64)
    return far.scatter_reduce(0, torch.as_tensor(hull.facet), distance, "amin")
