"""The solid that triangles of any kind bound: where they wind around a point."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from dicedesign.errors import missing_extra
from dicedesign.geometry.meshes.orientation import outward_patches
from dicedesign.geometry.repair.grid_surface import evened, surface_nets, without_double_cuts
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index


class Soup:
    """Triangles (t, 3) between points (n, 3), looked at by libigl."""

    def __init__(self, points: Floats, triangles: Integers) -> None:
        """Raises InputError without the extra `repair`."""
        try:
            import igl
        except ImportError as error:
            raise missing_extra("repair", "repair", error) from error
        self._igl: Any = igl
        self.points = np.ascontiguousarray(points, dtype=np.float64)
        self.triangles = np.ascontiguousarray(triangles, dtype=np.int64)
        self._tree = igl.AABB()
        self._tree.init(self.points, self.triangles)

    @property
    def area(self) -> float:
        """Of all triangles."""
        return float(norms(doubled_area_vectors(self.points, self.triangles)).sum()) / 2.0

    def turns(self, places: Floats) -> Floats:
        """(k,) winding numbers around places (k, 3)."""
        queries = np.ascontiguousarray(places)
        return np.asarray(self._igl.fast_winding_number(self.points, self.triangles, queries))

    def closest(self, places: Floats) -> Floats:
        """(k, 3) the points of the triangles that are closest to places (k, 3)."""
        queries = np.ascontiguousarray(places)
        if len(queries) == 0:
            return queries
        return np.asarray(self._tree.squared_distance(self.points, self.triangles, queries)[2])

    def pieces(self, longest: float) -> Floats:
        """(p, 3, 3) corners of the triangles, cut in halves until no edge is longer than that."""
        corners, done = self.points[self.triangles], []
        while len(corners):
            lengths = norms(np.roll(corners, -1, axis=1) - corners)
            long = lengths.max(axis=1) > longest
            done.append(corners[~long])
            start = lengths[long].argmax(axis=1)
            rows = np.arange(len(start))
            a, b, c = (corners[long][rows, (start + k) % 3] for k in range(3))
            middle = (a + b) / 2.0
            corners = np.concatenate(
                [np.stack(t, axis=1) for t in ((a, middle, c), (middle, b, c))]
            )
        return np.concatenate(done)


HALF: Final = 0.5
"""Turns around a point from which on it is inside."""

HALVINGS: Final = 5
"""Of an edge of the grid, or of as long a line, until the surface on it is found."""

ROUNDS: Final = 3
"""Times that points are moved and edges flipped."""

REACH: Final = 0.5
"""Distance, in cells, within which the surface is looked for."""

BESIDE: Final = 0.02
"""Distance from the closest triangle, in cells, at which one side is inside and one outside if it
is a triangle of the surface."""

BORDER: Final = 2.5
"""Cells of the grid beyond the box on each side: flat faces along the box are between nodes."""

THIN: Final = 1.0
"""A part is thin where it is thinner than so many cells: nodes of the grid may miss it."""

THICKENING: Final = 0.6
"""Cells by which a thin part is thickened on each side: nodes cannot miss it then."""

PIECES: Final = 2.0
"""Longest edges of the pieces of triangles that are thin or not, in cells."""


class WoundSolid:
    """All places around which triangles wind more than half a turn, and those beside thin parts.

    The winding number is a whole one where the triangles close, by shell on shell the more, and
    goes evenly across a hole: so a hole is covered, shells are joined, and walls inside are none.

    Attributes
    ----------
    soup: the triangles, wound alike.
    cell: side of the cells of the grid that is to show all parts.

    Source: Barill et al., Fast winding numbers for soups and clouds (2018).
    """

    def __init__(self, points: Floats, triangles: Integers, cells: int) -> None:
        """points: (n, 3) in a box of about 1; triangles: (t, 3); cells: of a grid, along the
        longest side. Raises InputError without the extra `repair`."""
        self.soup = Soup(points, outward_patches(points, triangles))
        self.cell = float(np.ptp(points, axis=0).max()) / cells
        self._thin: Soup | None = None
        self._thin = self._thin_parts()

    @property
    def thin_area(self) -> float:
        """Of the triangles over thin parts."""
        return 0.0 if self._thin is None else self._thin.area

    def holds(self, places: Floats) -> Booleans:
        """(k,) whether places (k, 3) are inside."""
        return np.asarray(self._depths(places) > 0.0)

    def surfaces(self, shift: float) -> tuple[Floats, Integers]:
        """Points and triangles of all surfaces of the solid, as closely as the grid tells.

        shift: of the grid, in cells. No two sheets are joined at a point or an edge; there are none
        where no node is inside.
        """
        origin = self.soup.points.min(axis=0) - (BORDER + shift) * self.cell
        counts = np.ceil(np.ptp(self.soup.points, axis=0) / self.cell).astype(np.int64) + 7
        nodes = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
        values = np.full(counts, -HALF)
        # Shells that are open on one side may wind around places beyond it: there it ends.
        within = (slice(1, -1),) * 3
        places = origin + self.cell * nodes[within].reshape(-1, 3)
        values[within] = self._depths(places).reshape(counts - 2)
        inside = without_double_cuts(values)

        def crossing(nodes: Integers, ahead: Integers) -> Floats:
            leaves = inside[tuple(nodes.T)][:, None]
            return self._between(
                origin + self.cell * np.where(leaves, nodes, ahead),
                origin + self.cell * np.where(leaves, ahead, nodes),
            )

        return surface_nets(inside, crossing)

    def evened(self, points: Floats, triangles: Integers) -> tuple[Floats, Integers]:
        """A surface from `surfaces` with even triangles, its points on that of the solid."""
        return evened(points, triangles, self._onto, ROUNDS)

    def _depths(self, places: Floats) -> Floats:
        """(k,) values above 0 inside, and larger the nearer to it outside, of places (k, 3)."""
        depths = self.soup.turns(places) - HALF
        if self._thin is not None:
            outer = np.flatnonzero(depths <= 0.0)
            near = norms(self._thin.closest(places[outer]) - places[outer])
            depths[outer[near < THICKENING * self.cell]] = HALF
        return depths

    def _thin_parts(self) -> Soup | None:
        """Pieces of the triangles where the solid beneath is thinner than `THIN`."""
        corners = self.soup.pieces(PIECES * self.cell)
        flat = corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
        vectors = doubled_area_vectors(*flat)
        normals = vectors / norms(vectors)[:, None].clip(np.finfo(float).tiny)
        middles = corners.mean(axis=1)
        outer = self._parts(middles, BESIDE * self.cell * normals)
        thin = np.flatnonzero(outer)
        thin = thin[~self.holds(middles[thin] - THIN * self.cell * normals[thin])]
        return Soup(flat[0], flat[1][thin]) if len(thin) else None

    def _onto(self, points: Floats, triangles: Integers) -> Floats:
        """Points moved to the closest of a triangle that parts inside from outside; where there is
        none near, to the surface along the normal, if it is within `REACH`."""
        vectors = doubled_area_vectors(points, triangles).repeat(3, axis=0)
        normals = sums_by_index(triangles.ravel(), vectors, len(points))
        normals /= norms(normals)[:, None].clip(np.finfo(float).tiny)
        moved = self.soup.closest(points)
        near = norms(moved - points) <= REACH * self.cell
        near[near] = self._parts(moved[near], BESIDE * self.cell * normals[near])
        far = np.flatnonzero(~near)
        moved[far] = points[far]
        reach = REACH * self.cell * normals[far]
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
