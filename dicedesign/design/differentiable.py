"""Resting probabilities as a differentiable function of vertices and center of mass.

The integers (which facets are stable, which edges each separatrix crosses) come from the forward
model in `dicedesign.rest`, and so do the values. Gradients are exact, those of the combinatorial
cell the vertices lie in: compiled kernels sweep back along each separatrix, or the coordinates are
evaluated again in torch with the forward model's formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign import kernels
from dicedesign.design.centroid import centroid_gradient, hull_centroid
from dicedesign.design.kernel_functions import adjoint_function
from dicedesign.errors import InputError
from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.geometry.hull_reuse import HullMaker
from dicedesign.geometry.ragged import ragged_ranges
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.morse import (
    Separatrices,
    basin_references,
    border_areas,
    separatrices,
    separatrix_points,
)
from dicedesign.rest.probabilities import (
    Basins,
    basin_areas,
    closed_areas,
    find_basins,
    tie_distance,
)

__all__ = ["RestEvaluation", "differentiable_rest", "evaluate_rests"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_TORCH: ModuleType = torch


@dataclass(frozen=True)
class RestEvaluation:
    """The rests of a hull, with coordinates in torch. Everything is computed on first use.

    Attributes
    ----------
    equilibria: the classified hull, whose numbers are the integers of this evaluation.
    vertices: (n, 3) hull vertices as tensor.
    given_center: (3,) center of mass as tensor, or None for that of the uniform solid.
    basins: those of the body, where they are known.
    """

    equilibria: Equilibria
    vertices: Tensor
    given_center: Tensor | None = None
    basins: Basins | None = None

    @cached_property
    def center(self) -> Tensor:
        """(3,) the center of mass."""
        given = self.given_center
        return hull_centroid(self.vertices, self.hull) if given is None else given

    @property
    def hull(self) -> ConvexHull:
        """The hull that the integers belong to."""
        return self.equilibria.hull

    def untied(self) -> RestEvaluation:
        """The same, which raises `Tie` at first use where the body is tied (`find_basins`)."""
        equilibria = self.equilibria
        distance = tie_distance(equilibria.hull, equilibria.center_of_mass)
        return replace(self, equilibria=replace(equilibria, tie_distance=distance))

    @cached_property
    def paths(self) -> Separatrices:
        """The separatrices that divide basins; rests are numbered as in `paths.rests`."""
        return separatrices(self.equilibria) if self.basins is None else self.basins.paths

    @cached_property
    def odds(self) -> Floats:
        """(k,) probabilities of the rests as numbers (eq. 9, 10).

        Raises DegenerateBodyError where the basins do not close, as `rest_poses` does.
        """
        basins = self.basins
        areas = basin_areas(self.equilibria, self.paths) if basins is None else basins.areas
        return areas / (4.0 * np.pi)

    @cached_property
    def probabilities(self) -> Tensor:
        """(k,) the same, with gradients."""
        compiled = kernels.compiled
        if compiled is None:
            return _probabilities(self)
        body = *self.paths.branches, self.hull.vertices, self.equilibria.center_of_mass

        def adjoint(gradient: Floats) -> tuple[Floats, Floats]:
            found: tuple[Floats, Floats] = compiled.area_gradient(*body, gradient / (4.0 * np.pi))
            return found

        return self.tensors((self.odds,), adjoint, lambda rests: (_probabilities(rests),))[0]

    def tensors(
        self,
        values: tuple[Floats, ...],
        adjoint: Callable[..., tuple[Floats, Floats]],
        plain: Callable[[RestEvaluation], tuple[Tensor, ...]],
    ) -> tuple[Tensor, ...]:
        """Tensors of known values that are functions of the body.

        adjoint: from the gradients of all of them to those in the vertices (n, 3) and in the
            center of mass (3,); plain: the same of any evaluation, by operations of torch.
        """
        # What a tensor keeps must not keep the tensor, which this evaluation does.
        bare = replace(self)
        if self.given_center is not None:

            def of_both(vertices: Tensor, center: Tensor) -> tuple[Tensor, ...]:
                return plain(replace(bare, vertices=vertices, given_center=center))

            return adjoint_function(values, adjoint, of_both, self.vertices, self.given_center)

        def of_all(*gradients: Floats) -> tuple[Floats]:
            return (bare.with_center(*adjoint(*gradients)),)

        def of_vertices(vertices: Tensor) -> tuple[Tensor, ...]:
            return plain(replace(bare, vertices=vertices))

        return adjoint_function(values, of_all, of_vertices, self.vertices)

    def with_center(self, by_vertices: Floats, by_center: Floats) -> Floats:
        """Gradient (n, 3) in the vertices, with which the center of mass of a uniform solid moves,
        for those in the vertices (n, 3) alone and in the center (3,)."""
        if self.given_center is not None:
            return by_vertices
        return by_vertices + centroid_gradient(self.hull, by_center)

    @property
    def slopes(self) -> Floats | None:
        """(k, 3 n) Jacobian of the probabilities in the vertices, with which the center of mass of
        a uniform solid moves; None without compiled kernels."""
        if kernels.compiled is None:
            return None
        vertices, center = self.hull.vertices, self.equilibria.center_of_mass
        by_vertices, by_center = kernels.compiled.area_jacobian(
            len(self.paths.rests), *self.paths.branches, vertices, center
        )
        if self.given_center is None:
            by_axis = [centroid_gradient(self.hull, axis).ravel() for axis in np.eye(3)]
            by_vertices = by_vertices + by_center @ np.stack(by_axis)
        slopes: Floats = by_vertices / (4.0 * np.pi)
        return slopes

    def facet_normals(self, facets: Integers) -> Tensor:
        """(len(facets), 3) unit normals of facets."""
        hull, compiled = self.hull, kernels.compiled
        if compiled is None:
            return _facet_normals(hull, facets, self.vertices)
        arrays = hull.facet_start, hull.tail, hull.vertices, facets
        return adjoint_function(
            (hull.normals[facets],),
            lambda gradient: (compiled.normal_gradient(*arrays, gradient),),
            lambda vertices: (_facet_normals(hull, facets, vertices),),
            self.vertices,
        )[0]

    @cached_property
    def rest_normals(self) -> Tensor:
        """(k, 3) unit normals of the stable facets."""
        return self.facet_normals(self.paths.rests)

    @cached_property
    def facet_depths(self) -> Tensor:
        """(m,) how far inside each facet the foot of the center of mass lies: its signed distance
        from the nearest edge's line over the circumscribed radius, positive for rests."""
        if kernels.compiled is None:
            return _facet_depths(self)
        adjoint = replace(self).depth_gradient
        return self.tensors((self.depths,), adjoint, lambda rests: (_facet_depths(rests),))[0]

    @cached_property
    def depths(self) -> Floats:
        """(m,) the same as numbers."""
        if kernels.compiled is None:
            return self.facet_depths.detach().numpy()
        depths: Floats = kernels.compiled.facet_depths(*self._facets)
        return depths

    def depth_gradient(self, slopes: Floats) -> tuple[Floats, Floats]:
        """Gradient of the sum of depths times slopes (m,), in the vertices (n, 3) and in the center
        (3,); for compiled kernels."""
        assert kernels.compiled is not None
        found: tuple[Floats, Floats] = kernels.compiled.depth_gradient(*self._facets, slopes)
        return found

    @property
    def _facets(self) -> tuple[Integers, Integers, Floats, Floats]:
        hull = self.hull
        return hull.facet_start, hull.tail, hull.vertices, self.equilibria.center_of_mass

    def vertex_directions(self, vertices: Integers) -> Tensor:
        """(len(vertices), 3) unit directions from the center of mass to vertices (eq. 6)."""
        radii = self.vertices[vertices] - self.center
        return radii / torch.linalg.vector_norm(radii, dim=1, keepdim=True)


def _probabilities(rests: RestEvaluation) -> Tensor:
    """(k,) with the formulas of the forward model."""
    paths, vertices, center = rests.paths, rests.vertices, rests.center
    count = len(paths.rests)
    if count == 1:
        return torch.ones(1, dtype=torch.float64) + 0.0 * (vertices.sum() + center.sum())
    points = separatrix_points(paths, vertices, center, _TORCH)
    # A closed loop's area does not depend on the reference direction: no gradient there.
    normals = rests.hull.normals[paths.rests]
    reference = torch.as_tensor(basin_references(paths, points.detach().numpy(), normals))
    border = border_areas(paths, points, reference, _TORCH)
    basins = torch.as_tensor(paths.basins.ravel())
    areas = torch.zeros(count, dtype=torch.float64).index_add(0, basins, border.reshape(-1))
    signed = areas.detach().numpy()
    areas = areas + torch.as_tensor(closed_areas(signed) - signed)
    return areas / (4.0 * torch.pi)


def _facet_normals(hull: ConvexHull, facets: Integers, vertices: Tensor) -> Tensor:
    """(len(facets), 3) from the area vectors of their polygons."""
    start = hull.facet_start[facets]
    owner, half_edges = ragged_ranges(start, hull.facet_start[facets + 1] - start)
    anchor = vertices[hull.tail[start]][owner]
    a = vertices[hull.tail[half_edges]] - anchor
    b = vertices[hull.head[half_edges]] - anchor
    vectors = torch.zeros((len(facets), 3), dtype=torch.float64)
    vectors = vectors.index_add(0, torch.as_tensor(owner), torch.linalg.cross(a, b))
    return vectors / torch.linalg.vector_norm(vectors, dim=1, keepdim=True)


def _facet_depths(rests: RestEvaluation) -> Tensor:
    """(m,) of all facets, edge by edge."""
    hull = rests.hull
    normals = rests.facet_normals(np.arange(len(hull.normals)))
    edges = rests.vertices[hull.head] - rests.vertices[hull.tail]
    radii = rests.vertices - rests.center
    circumscribed = torch.linalg.vector_norm(radii, dim=1).max()
    across = torch.linalg.cross(edges, normals[hull.facet])
    length = torch.linalg.vector_norm(edges, dim=1)
    distance = (radii[hull.tail] * across).sum(-1) / (length * circumscribed)
    far = torch.full((len(hull.normals),), torch.inf, dtype=torch.float64)
    return far.scatter_reduce(0, torch.as_tensor(hull.facet), distance, "amin")


def evaluate_rests(
    points: Tensor, center_of_mass: Tensor | None = None, hull_of: HullMaker = convex_hull
) -> RestEvaluation:
    """Hull and rests of points.

    Parameters
    ----------
    points: (n, 3) float64.
    center_of_mass: (3,) float64, or None for that of the uniform solid hull.
    hull_of: makes the hull.

    Raises
    ------
    InputError: not float64 tensors of these shapes.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.
    """
    if points.dtype != torch.float64 or points.ndim != 2 or points.shape[1] != 3:
        raise InputError(
            f"vertices: expected a float64 tensor of shape (n, 3), got {points.dtype} of shape "
            f"{tuple(points.shape)}; convert it with .double()"
        )
    hull = hull_of(points.detach().numpy())
    vertices = points
    if len(hull.source) < len(points):
        vertices = points[torch.as_tensor(hull.source)]
    if center_of_mass is None:
        return RestEvaluation(classify(hull, hull.centroid), vertices)
    if center_of_mass.dtype != torch.float64 or center_of_mass.shape != (3,):
        raise InputError(
            f"center of mass: expected a float64 tensor of shape (3,), got {center_of_mass.dtype} "
            f"of shape {tuple(center_of_mass.shape)}; convert it with .double(), or leave it out "
            "for the uniform solid"
        )
    center = center_of_mass.detach().numpy()
    return RestEvaluation(classify(hull, center), vertices, center_of_mass)


def differentiable_rest(
    vertices: Tensor, center_of_mass: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Rests of the convex hull of points, differentiable in the points and the center of mass.

    Parameters
    ----------
    vertices: (n, 3) float64 tensor, any length unit; points inside the hull get zero gradient.
    center_of_mass: (3,) float64 tensor strictly inside the hull, or None for that of the uniform
        solid hull, whose own gradient is then included.

    Returns
    -------
    normals: (k, 3) outward unit normals of the stable facets, the most probable first.
    probabilities: (k,) summing to 1.

    Raises
    ------
    InputError, DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.

    Of a body that balances within rounding the mean of both sides is returned, as by `rest_poses`.

    Source: algorithm 3, eq. 9 and 10; section 3.1.
    """
    rests = evaluate_rests(vertices, center_of_mass)
    center = rests.equilibria.center_of_mass
    sides = find_basins(rests.hull, center)
    hull = sides[0].equilibria.hull
    corners = vertices[torch.as_tensor(hull.source)]
    of_facet = torch.zeros(len(hull.normals), dtype=torch.float64)
    for side in sides:
        aside = side.equilibria.center_of_mass - center
        moved = rests.center + torch.as_tensor(aside) if aside.any() else rests.given_center
        beside = RestEvaluation(side.equilibria, corners, moved, side)
        of_facet = of_facet.index_add(0, torch.as_tensor(side.paths.rests), beside.probabilities)
    # Stable, so that equal rests keep the order of their facets.
    order = np.argsort(-of_facet.detach().numpy(), kind="stable")
    facets = order[: len(np.unique(np.concatenate([side.paths.rests for side in sides])))]
    return beside.facet_normals(facets), of_facet[torch.as_tensor(facets)] / len(sides)
