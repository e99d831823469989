"""Probabilities, normals and depths of a hull's facets by operations of torch.

Which facets are stable and which edges each separatrix crosses is given; the formulas say where, as
functions of the vertices and of the center of mass. They are what compiled kernels differentiate by
hand.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.rest.basins import closed_areas
from dicedesign.rest.morse import Separatrices, basin_references, border_areas, separatrix_points
from dicedesign.runtime.arrays import Integers, ragged_ranges

__all__ = ["facet_depths", "facet_normals", "rest_probabilities"]


def rest_probabilities(
    hull: ConvexHull, paths: Separatrices, vertices: Tensor, center: Tensor
) -> Tensor:
    """(k,) probabilities of the rests, with the formulas of the forward model (eq. 9, 10).

    paths: the separatrices that divide basins; vertices: (n, 3); center: (3,) center of mass.
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
    areas = areas + torch.as_tensor(closed_areas(signed) - signed)
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
    """(m,) signed distances of the center's foot from the nearest edge's line of each facet, over
    the circumscribed radius, edge by edge."""
    normals = facet_normals(hull, np.arange(len(hull.normals)), vertices)
    edges = vertices[hull.head] - vertices[hull.tail]
    radii = vertices - center
    circumscribed = torch.linalg.vector_norm(radii, dim=1).max()
    across = torch.linalg.cross(edges, normals[hull.facet])
    length = torch.linalg.vector_norm(edges, dim=1)
    distance = (radii[hull.tail] * across).sum(-1) / (length * circumscribed)
    far = torch.full((len(hull.normals),), torch.inf, dtype=torch.float64)
    return far.scatter_reduce(0, torch.as_tensor(hull.facet), distance, "amin")
