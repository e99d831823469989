"""The solid that triangles of any kind bound: where they wind around a point."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from dicedesign.errors import missing_extra
from dicedesign.geometry.meshes.orientation import outward_patches
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.evening import evened
from dicedesign.geometry.surfaces.surface_nets import surface_nets, without_double_cuts
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

__all__ = ["BESIDE", "WoundSolid", "distances_to_triangles"]

HALF: Final = 0.5
"""Turns around a point from which on it is inside."""

HALVINGS: Final = 5
"""Of an edge of the grid, or of as long a line, until the surface on it is found."""

ROUNDS: Final = 3
"""Times that points are moved and edges flipped."""

BESIDE: Final = 0.02
"""Distance from the closest triangle, in cells, at which one side is inside and one outside if it
is a triangle of the surface."""

BORDER: Final = 1.5
"""Cells of the grid beyond the box on each side: flat faces along the box are between nodes."""


class WoundSolid:
    """All points around which triangles wind more than half a turn.

    The winding number is a whole one where the triangles close, by shell on shell the more, and
    goes evenly across a hole: so a hole is covered, shells are joined, and walls inside are none.

    Source: Barill et al., Fast winding numbers for soups and clouds (2018).
    """

    def __init__(self, points: Floats, triangles: Integers) -> None:
        """points: (n, 3) in a box of about 1; triangles: (t, 3). Raises InputError without the
        extra `repair`."""
        self._igl = _igl()
        self.points = np.ascontiguousarray(points)
        self.triangles = np.ascontiguousarray(outward_patches(points, triangles))
        self._tree = self._igl.AABB()
        self._tree.init(self.points, self.triangles)

    def turns(self, places: Floats) -> Floats:
        """(k,) winding numbers around places (k, 3)."""
        return np.asarray(
            self._igl.fast_winding_number(
                self.points, self.triangles, np.ascontiguousarray(places, dtype=np.float64)
            )
        )

    def holds(self, places: Floats) -> Booleans:
        """(k,) whether places (k, 3) are inside."""
        return np.asarray(self.turns(places) > HALF)

    def closest(self, places: Floats) -> Floats:
        """(k, 3) the points of the triangles that are closest to places (k, 3)."""
        places = np.ascontiguousarray(places)
        return np.asarray(self._tree.squared_distance(self.points, self.triangles, places)[2])

    def surfaces(self, cells: int, shift: float) -> tuple[Floats, Integers]:
        """Points and triangles of all surfaces of the solid, as closely as a grid tells.

        cells: of the grid along the longest side; shift: of the grid, in cells. No two triangles
        are folded together at a point or an edge; none are there where no node is inside.
        """
        low, extents = self.points.min(axis=0), np.ptp(self.points, axis=0)
        step = float(extents.max()) / cells
        origin = low - (BORDER + shift) * step
        counts = np.ceil(extents / step).astype(np.int64) + 5
        nodes = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
        turns = np.zeros(counts)
        # Shells that are open on one side may wind around places beyond it: there it ends.
        within = (slice(1, -1),) * 3
        places = origin + step * nodes[within]
        turns[within] = self.turns(places.reshape(-1, 3)).reshape(places.shape[:3])
        inside = without_double_cuts(turns - HALF)

        def crossing(nodes: Integers, ahead: Integers) -> Floats:
            leaves = inside[tuple(nodes.T)][:, None]
            return self._between(
                origin + step * np.where(leaves, nodes, ahead),
                origin + step * np.where(leaves, ahead, nodes),
            )

        return surface_nets(inside, crossing)

    def evened(self, points: Floats, triangles: Integers, cell: float) -> tuple[Floats, Integers]:
        """A surface from `surfaces` with even triangles, its points on that of the solid; cell:
        side of the grid's cells."""
        return evened(
            points, triangles, lambda moved, joined: self._onto(moved, joined, cell), ROUNDS
        )

    def _onto(self, points: Floats, triangles: Integers, cell: float) -> Floats:
        """Points moved to the closest of a triangle that parts inside from outside; where there is
        none near, to the surface along the normal, if it is within half a cell."""
        vectors = doubled_area_vectors(points, triangles).repeat(3, axis=0)
        normals = sums_by_index(triangles.ravel(), vectors, len(points))
        normals /= norms(normals)[:, None].clip(np.finfo(float).tiny)
        moved = self.closest(points)
        near = norms(moved - points) <= HALF * cell
        near[near] = self._parts(moved[near], BESIDE * cell * normals[near])
        far = np.flatnonzero(~near)
        moved[far] = points[far]
        reach = HALF * cell * normals[far]
        parted = self._parts(points[far], reach)
        far, reach = far[parted], reach[parted]
        moved[far] = self._between(points[far] - reach, points[far] + reach)
        return moved

    def _parts(self, points: Floats, reach: Floats) -> Booleans:
        """(k,) whether the surface is between points (k, 3) moved by a reach inward and outward."""
        return self.holds(points - reach) & ~self.holds(points + reach)

    def _between(self, inner: Floats, outer: Floats) -> Floats:
        """(k, 3) points of the surface between one inside and one outside."""
        for _ in range(HALVINGS):
            middle = (inner + outer) / 2.0
            held = self.holds(middle)[:, None]
            inner, outer = np.where(held, middle, inner), np.where(held, outer, middle)
        return (inner + outer) / 2.0


def distances_to_triangles(places: Floats, points: Floats, triangles: Integers) -> Floats:
    """(k,) distances of places (k, 3) from triangles (t, 3) between points (n, 3)."""
    squares = _igl().point_mesh_squared_distance(
        *(np.ascontiguousarray(array) for array in (places, points, triangles))
    )[0]
    return np.sqrt(squares)


def _igl() -> Any:
    try:
        import igl
    except ImportError as error:
        raise missing_extra("repair", "repair", error) from error
    return igl
