"""Depths inside a closed surface, at the nodes of a cubic grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.ndimage import binary_dilation

from dicedesign.geometry.surfaces.distances import distances_from_surface
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges

__all__ = ["DepthGrid", "depth_grid"]

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
