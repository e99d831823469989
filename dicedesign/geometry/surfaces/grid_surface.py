"""Distances from a surface, depths inside it, and level sets of functions on a grid."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Any

import igl
import numpy as np
from manifold3d import Manifold
from scipy.spatial import KDTree

from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers


def closest_points(surface: Surface, places: Floats) -> tuple[Integers, Floats]:
    """Closest points (k, 3) of a surface to places (k, 3), and a triangle (k,) of each.

    The surface may be open or intersect itself.
    """
    if len(places) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    _, triangles, feet = igl.point_mesh_squared_distance(places, *_arrays(surface))
    return triangles, feet


def distances_from_surface(surface: Surface, places: Floats) -> Floats:
    """(k,) distances of places (k, 3) from a surface, in its unit of length."""
    return norms(closest_points(surface, places)[1] - places)


def depths_inside(surface: Surface, places: Floats) -> Floats:
    """(k,) distances of places (k, 3) from a closed surface inside it, and their negatives
    outside."""
    distances = distances_from_surface(surface, places)
    return np.where(winding_numbers(surface, places) > 0.5, distances, -distances)


def winding_numbers(surface: Surface, places: Floats) -> Floats:
    """(k,) winding numbers of an oriented surface, closed or not, around places (k, 3), to about
    0.01.

    Source: Barill et al., Fast winding numbers for soups and clouds (2018).
    """
    return np.asarray(igl.fast_winding_number(*_arrays(surface), places))


def _arrays(surface: Surface) -> tuple[Any, Any]:
    """Points and triangles with the types and memory layout that libigl takes."""
    return (
        np.ascontiguousarray(surface.points, dtype=np.float64),
        np.ascontiguousarray(surface.triangles, dtype=np.int64),
    )


class GridValues:
    """Values of a function on the body-centered cubic grid of `manifold3d.Manifold.level_set`.

    Attributes
    ----------
    nodes: (n, 3) of the grid.
    values: (n,) of the function.
    cell: side of a cube as large as the space of one node.
    """

    def __init__(
        self, function: Callable[[Floats], Floats], low: Floats, high: Floats, spacing: float
    ) -> None:
        """function: maps places (n, 3) to values (n,); low, high: (3,) corners of a box; spacing:
        of the grid, positive."""
        self._grid = (*low.tolist(), *high.tolist()), spacing
        # A list of places would take ten times as much memory.
        numbers = array("d")

        def record(*place: float) -> float:
            numbers.extend(place)
            return -1.0

        # It calls a function once for each node, and in the same order each time.
        Manifold.level_set(record, *self._grid)
        self.nodes = np.frombuffer(numbers).reshape(-1, 3)
        parts = np.array_split(self.nodes, 1 + len(self.nodes) // MAX_PLACES)
        self.values = np.concatenate([function(part) for part in parts])
        self.cell = float(spacing * NODES_PER_CUBE ** (-1.0 / 3.0))

    def above(self, level: float) -> Surface:
        """Surface of the part of the box where the function, interpolated, is above a level.

        Where sheets of it would meet in a point, nodes beside the point count as outside, so that
        the surface is a manifold that does not meet itself. It has no triangles where no node is
        inside.
        """
        values, tree = self.values - level, None
        while True:
            rest = iter(memoryview(values.data))
            surface = mesh_of(Manifold.level_set(lambda *_, rest=rest: next(rest), *self._grid))
            # manifold3d has such a point once for each sheet.
            places, count = np.unique(surface.points, axis=0, return_counts=True)
            if (count == 1).all():
                return surface
            tree = tree or KDTree(self.nodes)
            beside = tree.query_ball_point(places[count > 1], MEETING * self._grid[1])
            values[np.concatenate(beside).astype(np.int64)] = values.min()


MAX_PLACES = 200_000
"""Nodes whose values are computed at once."""

MEETING = 0.75
"""Distance, in spacings of the grid, of nodes from a point where sheets meet that count as
outside."""

NODES_PER_CUBE = 2.0
"""Nodes of a body-centered cubic grid in each cube of its spacing: corners and centers."""
