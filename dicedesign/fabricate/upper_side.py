"""The side of a body that is seen from above: where a mark has room, and the layer it is cut from.

Lengths are in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dicedesign.fabricate.relief import Relief, cross, relief
from dicedesign.geometry.triangles import doubled_area_vectors, edge_neighbors

__all__ = ["UpperSide", "upper_side"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_STEEPEST: Final = 1.0
"""Slope of the surface beneath a mark, as rise over run."""

_UPWARD: Final = 0.1
"""Cosine of the angle between the upright and the normal of any triangle beneath a mark."""

_FLOOR: Final = 2.0
"""Thickness of the body beneath a mark before it is cut, in depths of the mark."""


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
        good = self.relief.thickness >= _FLOOR * depth
        z = np.pad(np.where(good, self.relief.height, np.nan), 1, constant_values=np.nan)
        reach = _STEEPEST * self.relief.spacing
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
        graph = coo_array((np.ones(len(one)), (one, across[one, edge])), shape=2 * across.shape[:1])
        sheet = connected_components(graph, directed=False)[1]
        # The sheet that is seen at the middle.
        a, b, c = corners[near].transpose(1, 0, 2)
        inside = np.all([cross(p, q, middle) >= 0.0 for p, q in ((a, b), (b, c), (c, a))], axis=0)
        if not inside.any():
            return None
        seen = np.flatnonzero(inside)[np.argmax(np.where(inside, a[:, 2], -np.inf)[inside])]
        kept = sheet == sheet[seen]
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
    upward = normals[:, 2] > _UPWARD * np.linalg.norm(normals, axis=1)
    return UpperSide(turn, turned, triangles[upward], relief(turned, triangles))
