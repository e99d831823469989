"""A body seen straight from above: how high it is where and how thick, where a mark has room, and
the layer that the mark is cut from.

Lengths are in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from scipy.ndimage import maximum_filter, minimum_filter

from dicedesign.geometry.triangles import connected_parts, doubled_area_vectors, edge_neighbors
from dicedesign.runtime.arrays import Floats, Integers, ragged_ranges

__all__ = ["Relief", "UpperSide", "relief", "upper_side"]

STEEPEST: Final = 1.0
"""Slope of the surface beneath a mark, as rise over run."""

UPWARD: Final = 0.1
"""Cosine of the angle between the upright and the normal of any triangle beneath a mark."""

FLOOR: Final = 2.0
"""Thickness of the body beneath a mark before it is cut, in depths of the mark."""


SAMPLES: Final = 160
"""Nodes of a relief along the larger of its extents."""


@dataclass(frozen=True, eq=False)
class Relief:
    """Samples at the nodes of a square grid in the plane of x and y.

    Attributes
    ----------
    corner: (2,) x and y of the first node.
    spacing: between nodes.
    height: (a, b) z of the highest point of the body above each node, along x and y; -inf beside
        the body.
    thickness: (a, b) depth of the body from there down to where it ends or is hollow; 0 beside it.
    """

    corner: Floats
    spacing: float
    height: Floats
    thickness: Floats


@dataclass(frozen=True, eq=False)
class UpperSide:
    """A body turned so that the side to mark is up.

    Attributes
    ----------
    turn: (3, 3) rows right, up on the mark, and up from the table, in the body.
    points: (n, 3) of the body, turned: `body_points @ turn.T`.
    triangles: (t, 3) of those that face upward.
    relief: of the turned body.
    """

    turn: Floats
    points: Floats
    triangles: Integers
    relief: Relief

    def unevenness(self, depth: float, width: float, height: float) -> Floats:
        """(a, b) how far the surface rises and falls within a box of a width and a height about
        each node; inf where the box does not lie on the body or the body beneath it is steeper
        than 45 degrees or not solid to twice a depth."""
        good = self.relief.thickness >= FLOOR * depth
        z = np.pad(np.where(good, self.relief.height, np.nan), 1, constant_values=np.nan)
        reach = STEEPEST * self.relief.spacing
        along_x = np.abs(np.diff(z, axis=0))[:, 1:-1] <= reach
        along_y = np.abs(np.diff(z, axis=1))[1:-1] <= reach
        gentle = along_x[1:] & along_x[:-1] & along_y[:, 1:] & along_y[:, :-1]
        half = np.ceil(0.5 * np.array([width, height]) / self.relief.spacing).astype(np.int64)
        size = tuple((2 * half + 1).tolist())
        # Steep nodes are infinitely high, and so are those beyond the grid.
        low = minimum_filter(np.where(gentle, self.relief.height, np.inf), size)
        high = maximum_filter(
            np.where(gentle, self.relief.height, np.inf), size, cval=np.inf, mode="constant"
        )
        uneven = np.full(high.shape, np.inf)
        np.subtract(high, low, out=uneven, where=np.isfinite(high))
        return uneven

    def layer(
        self, middle: Floats, width: float, height: float, above: float, below: float
    ) -> Manifold | None:
        """The surface about a box, thickened: a solid between it moved up and it moved down.

        middle: (3,) point of the surface in the middle of the box, turned. Returns None where the
        surface there is no sheet that can be thickened.
        """
        half = 0.5 * np.array([width, height])
        corners = self.points[self.triangles]
        highest, lowest = corners[..., :2].max(axis=1), corners[..., :2].min(axis=1)
        near = ((highest >= middle[:2] - half) & (lowest <= middle[:2] + half)).all(axis=1)
        triangles = self.triangles[near]
        if not len(triangles):
            return None
        across = edge_neighbors(triangles)
        one, edge = np.nonzero(across >= 0)
        sheet = connected_parts(one, across[one, edge], len(across))
        # The sheet that is seen at the middle.
        a, b, c = corners[near].transpose(1, 0, 2)
        inside = np.all([_areas(p, q, middle) >= 0.0 for p, q in ((a, b), (b, c), (c, a))], axis=0)
        if not inside.any():
            return None
        highest_at_middle = np.flatnonzero(inside)[
            np.argmax(np.where(inside, a[:, 2], -np.inf)[inside])
        ]
        kept = sheet == sheet[highest_at_middle]
        used, flat = np.unique(triangles[kept], return_inverse=True)
        flat = flat.reshape(-1, 3)
        row, corner = np.nonzero(across[kept] < 0)
        tail, head = flat[row, (corner + 1) % 3], flat[row, (corner + 2) % 3]
        bottom = len(used)
        faces = np.concatenate(
            [
                flat,
                flat[:, ::-1] + bottom,
                np.column_stack([head, tail, tail + bottom]),
                np.column_stack([head, tail + bottom, head + bottom]),
            ]
        )
        top = self.points[used]
        upright = np.array([0.0, 0.0, 1.0])
        points = np.concatenate([top + above * upright, top - below * upright])
        solid = Manifold(Mesh64(points, faces.astype(np.uint64)))
        return solid if solid.status() == Error.NoError else None


def upper_side(points: Floats, triangles: Integers, up: Floats) -> UpperSide:
    """A body of points (n, 3) and triangles (t, 3) with a unit direction (3,) up.

    Right is where the body is longest as seen from above.
    """
    flat = points - points.mean(axis=0)
    flat -= np.outer(flat @ up, up)
    right = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    right = right * np.sign(right[np.argmax(np.abs(right))])
    right -= up * (up @ right)
    right /= np.linalg.norm(right)
    turn = np.stack([right, np.cross(up, right), up])
    turned = points @ turn.T
    normals = doubled_area_vectors(turned, triangles)
    upward = normals[:, 2] > UPWARD * np.linalg.norm(normals, axis=1)
    return UpperSide(turn, turned, triangles[upward], relief(turned, triangles))


def relief(points: Floats, triangles: Integers) -> Relief:
    """The heights of a body of points (n, 3) and triangles (t, 3), at `SAMPLES` nodes along the
    larger of its extents along x and y."""
    low, extent = points[:, :2].min(axis=0), np.ptp(points[:, :2], axis=0)
    spacing = float(extent.max()) / SAMPLES
    shape = tuple((np.ceil(extent / spacing).astype(np.int64) + 2).tolist())
    # Off the points' own coordinates, so that nodes seldom lie on edges.
    corner = low - (np.sqrt(0.5), np.sqrt(0.3)) * np.array([spacing, spacing])
    grid = np.column_stack([(points[:, :2] - corner) / spacing, points[:, 2]])[triangles]
    # Upright triangles hide nothing.
    a, b, c = grid.transpose(1, 0, 2)
    grid = grid[_areas(a, b, c) != 0.0]
    first = np.ceil(grid[..., :2].min(axis=1)).astype(np.int64)
    count = np.floor(grid[..., :2].max(axis=1)).astype(np.int64) - first + 1
    owner, place = ragged_ranges(np.zeros(len(grid), dtype=np.int64), count.clip(0).prod(axis=1))
    row, column = first[owner].T + np.stack(np.divmod(place, count[owner, 1]))
    a, b, c = grid[owner].transpose(1, 0, 2)
    node = np.stack([row, column], axis=-1)
    one, other = np.stack([_areas(node, b, c), _areas(a, node, c)]) / _areas(a, b, c)
    hit = (one >= 0.0) & (other >= 0.0) & (one + other <= 1.0)
    z = (one * a[:, 2] + other * b[:, 2] + (1.0 - one - other) * c[:, 2])[hit]
    key = np.ravel_multi_index((row[hit], column[hit]), shape)

    # The highest two surfaces above each node: the body lies between them.
    order = np.lexsort((-z, key))
    key, z = key[order], z[order]
    fresh = np.diff(key, prepend=-1) != 0
    top = np.flatnonzero(fresh)
    second = np.flatnonzero(fresh[:-1] & ~fresh[1:])
    height, thickness = np.full(shape, -np.inf), np.zeros(shape)
    height.ravel()[key[top]] = z[top]
    thickness.ravel()[key[second]] = z[second] - z[second + 1]
    return Relief(corner, spacing, height, thickness)


def _areas(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the signed areas (...) of triangles as seen from above, z being ignored."""
    u, v = b[..., :2] - a[..., :2], c[..., :2] - a[..., :2]
    doubled: Floats = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return doubled
