"""A body seen straight from above: how high it is where, and how thick.

Lengths are in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.ragged import ragged_ranges

__all__ = ["Relief", "cross", "relief"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_SAMPLES: Final = 160


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


def relief(points: Floats, triangles: Integers) -> Relief:
    """The heights of a body of points (n, 3) and triangles (t, 3), at 160 nodes along the larger
    of its extents along x and y."""
    low, extent = points[:, :2].min(axis=0), np.ptp(points[:, :2], axis=0)
    spacing = float(extent.max()) / _SAMPLES
    shape = tuple((np.ceil(extent / spacing).astype(np.int64) + 2).tolist())
    # Off the points' own coordinates, so that nodes seldom lie on edges.
    corner = low - (np.sqrt(0.5), np.sqrt(0.3)) * np.array([spacing, spacing])
    grid = np.column_stack([(points[:, :2] - corner) / spacing, points[:, 2]])[triangles]
    # Upright triangles hide nothing.
    a, b, c = grid.transpose(1, 0, 2)
    grid = grid[cross(a, b, c) != 0.0]
    first = np.ceil(grid[..., :2].min(axis=1)).astype(np.int64)
    count = np.floor(grid[..., :2].max(axis=1)).astype(np.int64) - first + 1
    owner, place = ragged_ranges(np.zeros(len(grid), dtype=np.int64), count.clip(0).prod(axis=1))
    row, column = first[owner].T + np.stack(np.divmod(place, count[owner, 1]))
    a, b, c = grid[owner].transpose(1, 0, 2)
    node = np.stack([row, column], axis=-1)
    one, other = np.stack([cross(node, b, c), cross(a, node, c)]) / cross(a, b, c)
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


def cross(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the signed areas (...) of triangles as seen from above, z being ignored."""
    u, v = b[..., :2] - a[..., :2], c[..., :2] - a[..., :2]
    doubled: Floats = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return doubled
