"""Resting probabilities as a differentiable function of vertices and center of mass.

The integers (which facets are stable, which edges each separatrix crosses) come from the forward
model in `dicedesign.rest`; the coordinates are evaluated again in torch with the same formulas. The
result is exact and its gradient is that of the combinatorial cell the vertices lie in.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.geometry.hull_reuse import HullMaker
from dicedesign.geometry.mass import stretch_matrix
from dicedesign.geometry.ragged import ragged_ranges
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.morse import (
    Separatrices,
    basin_references,
    border_areas,
    separatrices,
    separatrix_points,
)
from dicedesign.rest.probabilities import closed_areas, find_basins, tie_distance

__all__ = ["RestEvaluation", "differentiable_rest", "evaluate_rests", "hull_centroid"]

_TORCH: ModuleType = torch


@dataclass(frozen=True)
class RestEvaluation:
    """The rests of a hull, with coordinates in torch. Everything is computed on first use.

    Attributes
    ----------
    equilibria: the classified hull, whose numbers are the integers of this evaluation.
    vertices: (n, 3) hull vertices as tensor.
    center: (3,) center of mass as tensor.
    traced: the separatrices, where they are known.
    """

    equilibria: Equilibria
    vertices: Tensor
    center: Tensor
    traced: Separatrices | None = None

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
        return self.traced or separatrices(self.equilibria)

    @cached_property
    def probabilities(self) -> Tensor:
        """(k,) probabilities of the rests (eq. 9, 10).

        Raises DegenerateBodyError where the basins do not close, as `rest_poses` does.
        """
        rests = len(self.paths.rests)
        if rests == 1:
            anything = self.vertices.sum() + self.center.sum()
            return torch.ones(1, dtype=torch.float64) + 0.0 * anything
        points = separatrix_points(self.paths, self.vertices, self.center, _TORCH)
        # A closed loop's area does not depend on the reference direction: no gradient there.
        normals = self.hull.normals[self.paths.rests]
        reference = torch.as_tensor(basin_references(self.paths, points.detach().numpy(), normals))
        border = border_areas(self.paths, points, reference, _TORCH)
        basins = torch.as_tensor(self.paths.basins.ravel())
        areas = torch.zeros(rests, dtype=torch.float64).index_add(0, basins, border.reshape(-1))
        signed = areas.detach().numpy()
        areas = areas + torch.as_tensor(closed_areas(signed) - signed)
        return areas / (4.0 * torch.pi)

    def facet_normals(self, facets: NDArray[np.int64]) -> Tensor:
        """(len(facets), 3) unit normals of facets, from the area vectors of their polygons."""
        start = self.hull.facet_start[facets]
        owner, half_edges = ragged_ranges(start, self.hull.facet_start[facets + 1] - start)
        anchor = self.vertices[self.hull.tail[start]][owner]
        a = self.vertices[self.hull.tail[half_edges]] - anchor
        b = self.vertices[self.hull.head[half_edges]] - anchor
        cross = torch.linalg.cross(a, b)
        vectors = torch.zeros((len(facets), 3), dtype=torch.float64)
        vectors = vectors.index_add(0, torch.as_tensor(owner), cross)
        return vectors / torch.linalg.vector_norm(vectors, dim=1, keepdim=True)

    @cached_property
    def rest_normals(self) -> Tensor:
        """(k, 3) unit normals of the stable facets."""
        return self.facet_normals(self.paths.rests)

    @cached_property
    def facet_depths(self) -> Tensor:
        """(m,) how far inside each facet the foot of the center of mass lies: its signed distance
        from the nearest edge's line over the circumscribed radius, positive for rests."""
        hull = self.hull
        normals = self.facet_normals(np.arange(len(hull.normals)))
        edges = self.vertices[hull.head] - self.vertices[hull.tail]
        radii = self.vertices - self.center
        circumscribed = torch.linalg.vector_norm(radii, dim=1).max()
        across = torch.linalg.cross(edges, normals[hull.facet])
        length = torch.linalg.vector_norm(edges, dim=1)
        distance = (radii[hull.tail] * across).sum(-1) / (length * circumscribed)
        far = torch.full((len(hull.normals),), torch.inf, dtype=torch.float64)
        return far.scatter_reduce(0, torch.as_tensor(hull.facet), distance, "amin")

    def vertex_directions(self, vertices: NDArray[np.int64]) -> Tensor:
        """(len(vertices), 3) unit directions from the center of mass to vertices (eq. 6)."""
        radii = self.vertices[vertices] - self.center
        return radii / torch.linalg.vector_norm(radii, dim=1, keepdim=True)


def hull_centroid(vertices: Tensor, triangles: NDArray[np.int64]) -> Tensor:
    """Center of mass (3,) of the uniform solid with vertices (n, 3) and triangles (t, 3).

    That of a needle or a plate is computed before it is stretched (`stretch_matrix`); the stretch
    counts as constant, as it changes the rounding only.
    """
    origin = vertices.detach().mean(dim=0)
    offsets = vertices - origin
    centroid, sixfold = _sums(offsets, triangles)
    stretch = stretch_matrix(offsets.detach().numpy(), sixfold.item() / 6.0)
    if stretch is not None:
        matrix = torch.as_tensor(stretch)
        image = torch.linalg.solve(matrix, offsets, left=False)
        centroid = _sums(image, triangles)[0] @ matrix
    return origin + centroid


def _sums(offsets: Tensor, triangles: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
    """Centroid (3,) and sixfold volume by tetrahedra from the origin."""
    a, b, c = (offsets[triangles[:, k]] for k in range(3))
    sixfold = (a * torch.linalg.cross(b, c)).sum(-1)
    moment = (sixfold[:, None] * (a + b + c)).sum(0) / 4.0
    total = sixfold.sum()
    return moment / total, total


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
    vertices = points[torch.as_tensor(hull.source)]
    if center_of_mass is None:
        center = hull_centroid(vertices, hull.triangles)
    elif center_of_mass.dtype != torch.float64 or center_of_mass.shape != (3,):
        raise InputError(
            f"center of mass: expected a float64 tensor of shape (3,), got {center_of_mass.dtype} "
            f"of shape {tuple(center_of_mass.shape)}; convert it with .double(), or leave it out "
            "for the uniform solid"
        )
    else:
        center = center_of_mass
    return RestEvaluation(classify(hull, center.detach().numpy()), vertices, center)


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
        moved = rests.center + torch.as_tensor(side.equilibria.center_of_mass - center)
        beside = RestEvaluation(side.equilibria, corners, moved, side.paths)
        of_facet = of_facet.index_add(0, torch.as_tensor(side.paths.rests), beside.probabilities)
    # Stable, so that equal rests keep the order of their facets.
    order = np.argsort(-of_facet.detach().numpy(), kind="stable")
    facets = order[: len(np.unique(np.concatenate([side.paths.rests for side in sides])))]
    return beside.facet_normals(facets), of_facet[torch.as_tensor(facets)] / len(sides)
