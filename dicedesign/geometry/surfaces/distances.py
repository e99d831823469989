"""Distances of points from a triangle surface, the points of it that are closest, and depths inside
it at the nodes of a cubic grid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.spatial.distance import cdist

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges

PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a point and a triangle that are compared at a time, to bound the memory."""


def distances_from_surface(surface: Surface, points: Floats) -> Floats:
    """(k,) distances of points (k, 3) from a surface, in its unit of length."""
    corners = surface.points[surface.triangles]
    least = np.full(len(points), np.inf)
    for query, triangle in _near_pairs(corners, points):
        weights = _closest_in_triangles(points[query], corners[triangle])
        squares = _squares(weights, corners[triangle], points[query])
        np.minimum.at(least, query, np.sqrt(squares))
    return least


def closest_points(surface: Surface, points: Floats) -> tuple[Integers, Floats]:
    """The points of a surface that are closest to others (k, 3): the triangle (k,) of each, and the
    weights (k, 3) of its corners, not negative and of sum 1. Of points as close, the first."""
    corners = surface.points[surface.triangles]
    triangles = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 3))
    for query, triangle in _near_pairs(corners, points):
        inside = _closest_in_triangles(points[query], corners[triangle])
        feet = (inside[:, :, None] * corners[triangle]).sum(1)
        order = np.lexsort((triangle, norms(feet - points[query]), query))
        some, first = np.unique(query[order], return_index=True)
        triangles[some], weights[some] = triangle[order[first]], inside[order[first]]
    return triangles, weights


def _near_pairs(corners: Floats, points: Floats) -> Iterator[tuple[Integers, Integers]]:
    """Numbers of points (k, 3) and of triangles (t, 3, 3), in pairs, among which the closest of
    each point is; all of a point come together.

    Only triangles whose circle about their mean corner comes as near as that of some other goes at
    most are looked at closely.
    """
    centers = corners.mean(axis=1)
    radii = norms(corners - centers[:, None]).max(axis=1)
    rows = max(1, PAIRS_AT_ONCE // len(centers))
    for first in range(0, len(points), rows):
        distances = cdist(points[first : first + rows], centers)
        # Each triangle has a point at most this far, and none nearer than the other.
        bound = (distances + radii).min(axis=1)
        query, triangle = np.nonzero(distances - radii <= bound[:, None])
        yield first + query, triangle


def _closest_in_triangles(points: Floats, corners: Floats) -> Floats:
    """(m, 3) weights of the corners of triangles (m, 3, 3) of which the mean is closest to points
    (m, 3)."""
    weights, inside = _feet(points, corners)
    squares = np.where(inside, _squares(weights, corners, points), np.inf)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        part = _along_edges(points, corners[:, start], corners[:, end])
        beside = np.zeros_like(weights)
        beside[:, start], beside[:, end] = 1.0 - part, part
        square = _squares(beside, corners, points)
        nearer = square < squares
        weights = np.where(nearer[:, None], beside, weights)
        squares = np.minimum(squares, square)
    return weights


def _squares(weights: Floats, corners: Floats, points: Floats) -> Floats:
    offsets = (weights[:, :, None] * corners).sum(1) - points
    return np.asarray((offsets * offsets).sum(-1))


def _along_edges(points: Floats, starts: Floats, ends: Floats) -> Floats:
    """(m,) part of the way from starts to ends (m, 3) that leads nearest to points (m, 3)."""
    edge = ends - starts
    length = (edge * edge).sum(-1)
    along = ((points - starts) * edge).sum(-1)
    return np.clip(along / np.where(length > 0.0, length, 1.0), 0.0, 1.0)


def _feet(points: Floats, corners: Floats) -> tuple[Floats, Booleans]:
    """Weights (m, 3) of the corners of which the means are the feet of the perpendiculars from
    points onto the planes of triangles, and whether these are inside, as none of a flat one is."""
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    normal = np.linalg.cross(opposite[:, 1], opposite[:, 2])
    squared = (normal * normal).sum(-1)
    arms = points[:, None] - np.roll(corners, -1, axis=1)
    weights = (np.linalg.cross(opposite, arms) * normal[:, None]).sum(-1)
    inside = (squared > 0.0) & (weights >= 0.0).all(axis=1)
    return weights / np.where(squared > 0.0, squared, 1.0)[:, None], inside


BESIDE: Final = (np.sqrt(0.3), np.sqrt(0.5), np.sqrt(0.7))
"""Steps from the first nodes to the lowest coordinates of a surface, along each axis: nodes seldom
lie on it then."""


@dataclass(frozen=True, eq=False)
class DepthGrid:
    """A cubic grid about a surface.

    Attributes
    ----------
    corner: (3,) the first node.
    spacing: between nodes.
    depths: (a, b, c) of the nodes: distance from the surface inside, and its negative outside,
        where it is -inf but for nodes next to one inside. All on the border of the grid are
        outside.
    """

    corner: Floats
    spacing: float
    depths: Floats

    def places(self, nodes: Integers) -> Floats:
        """(m, 3) places of nodes (m, 3)."""
        return self.corner + self.spacing * nodes


def depth_grid(surface: Surface, steps: int) -> DepthGrid:
    """The depths inside a surface on a grid with so many steps along its longest extent."""
    low, extent = surface.points.min(axis=0), np.ptp(surface.points, axis=0)
    spacing = float(extent.max()) / steps
    corner = low - spacing * np.array(BESIDE)
    shape = np.ceil(extent / spacing).astype(np.int64) + 2
    inside = _inside((surface.points - corner) / spacing, surface.triangles, shape)
    depths = np.full(inside.shape, -np.inf)
    near = binary_dilation(inside)
    distances = distances_from_surface(surface, corner + spacing * np.argwhere(near))
    depths[near] = np.where(inside[near], distances, -distances)
    return DepthGrid(corner, spacing, depths)


def _inside(points: Floats, triangles: Integers, shape: Integers) -> Booleans:
    """(a, b, c) whether nodes with whole coordinates are inside a closed surface: where it is
    crossed an odd number of times on the way to them along z."""
    corners = points[triangles]
    first = np.ceil(corners[..., :2].min(axis=1)).astype(np.int64)
    count = np.floor(corners[..., :2].max(axis=1)).astype(np.int64) - first + 1
    owner, place = ragged_ranges(np.zeros(len(corners), dtype=np.int64), count.clip(0).prod(axis=1))
    column = first[owner] + np.stack(np.divmod(place, count[owner, 1]), axis=-1)
    sides = []
    for k in range(3):
        # Both triangles of an edge decide alike on which side of it a column is.
        ends = np.sort(triangles[:, [k, (k + 1) % 3]], axis=1)
        tail, head = points[ends[owner, 0], :2], points[ends[owner, 1], :2]
        left = _turn(head - tail, column - tail) >= 0.0
        sides.append(left ^ (triangles[owner, k] != ends[owner, 0]))
    crossed = (sides[0] == sides[1]) & (sides[1] == sides[2])
    owner, column = owner[crossed], column[crossed]
    a, b, c = corners[owner].transpose(1, 0, 2)
    normal = np.linalg.cross(b - a, c - a)
    height = a[:, 2] - ((column - a[:, :2]) * normal[:, :2]).sum(-1) / normal[:, 2]
    node = np.ceil(np.clip(height, 0.0, shape[2] - 1.0)).astype(np.int64)
    crossings = np.zeros(tuple(shape.tolist()), dtype=np.int64)
    np.add.at(crossings, (*column.T, node), 1)
    return np.asarray(np.cumsum(crossings, axis=2) % 2 == 1)


def _turn(u: Floats, v: Floats) -> Floats:
    """(m,) u x v of vectors in a plane."""
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
