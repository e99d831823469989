"""Which triangle an orthographic camera sees in each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers, ragged_ranges

__all__ = ["Camera", "rasterize"]


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic camera with a square picture.

    Attributes
    ----------
    direction: (3,) from the body to the camera, of any length above 0.
    up: (3,) upward on the picture; not parallel to the direction.
    center: (3,) point in the middle of the picture.
    half_width: half the side of the picture, in the body's length unit, above 0.
    """

    direction: Floats
    up: Floats
    center: Floats
    half_width: float

    def frame(self) -> Floats:
        """(3, 3) rows right, up and toward the camera, all unit."""
        toward = self.direction / np.linalg.norm(self.direction)
        right = np.cross(self.up, toward)
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(toward, right), toward])

    def pixel_positions(self, vertices: Floats, size: int) -> Floats:
        """Vertices (n, 3) as column, row from the top, and depth toward the camera, in pixels of a
        picture of `size` pixels a side."""
        scale = size / (2.0 * self.half_width)
        positions = (vertices - self.center) @ self.frame().T * scale
        return positions * np.array([1.0, -1.0, 1.0]) + np.array([size / 2.0, size / 2.0, 0.0])


def rasterize(positions: Floats, triangles: Integers, size: int) -> tuple[Integers, Floats]:
    """Nearest triangle in each pixel, by a depth buffer.

    A pixel sees a triangle if it contains the pixel's centre; triangles with a common edge leave
    no gap between them. Both sides of a triangle are seen.

    Parameters
    ----------
    positions: (n, 3) column, row and depth in pixels; greater depths are nearer.
    triangles: (t, 3) indices of positions.
    size: pixels a side.

    Returns
    -------
    (size, size) triangle of each pixel, or -1, and (size, size) its depth, or -inf.
    """
    picture = kernels.rasterize(positions, triangles, size)
    if picture is not None:
        return picture
    owner, row, left, right = _spans(positions[triangles], size)
    first = np.ceil(left[:, 0] - 0.5).clip(0, size).astype(np.int64)
    count = (np.ceil(right[:, 0] - 0.5).clip(0, size).astype(np.int64) - first).clip(0)
    span, column = ragged_ranges(first, count)
    # A span that contains the centre of a pixel has a width above 0.
    slope = np.zeros(len(owner))
    np.divide(right[:, 1] - left[:, 1], right[:, 0] - left[:, 0], out=slope, where=count > 0)
    depth = column + 0.5
    depth -= left[:, 0].repeat(count)
    depth *= slope.repeat(count)
    depth += left[:, 1].repeat(count)
    pixel = (row * size).repeat(count) + column
    nearest = np.full(size * size, -np.inf)
    np.maximum.at(nearest, pixel, depth)
    seen = np.full(size * size, -1, dtype=np.int64)
    front = depth == nearest[pixel]
    seen[pixel[front]] = owner[span[front]]
    return seen.reshape(size, size), nearest.reshape(size, size)


def _spans(corners: Floats, size: int) -> tuple[Integers, Integers, Floats, Floats]:
    """Where the centre lines of pixel rows cut triangles (t, 3, 3).

    Returns the triangle and the row (s,) of each span and its ends (s, 2): column and depth.
    """
    rows = corners[:, :, 1]
    first = np.ceil(rows.min(axis=1) - 0.5).clip(0, size).astype(np.int64)
    count = (np.ceil(rows.max(axis=1) - 0.5).clip(0, size).astype(np.int64) - first).clip(0)
    owner, row = ragged_ranges(first, count)
    center = row + 0.5
    left, right = np.full((len(owner), 2), np.inf), np.full((len(owner), 2), -np.inf)
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        # Both triangles at an edge compute the same crossings if both start at its upper end.
        swap = (a[:, 1] > b[:, 1])[:, None]
        a, b = np.where(swap, b, a), np.where(swap, a, b)
        cut = np.flatnonzero((a[:, 1][owner] <= center) & (b[:, 1][owner] > center))
        edge = owner[cut]
        a, b = a[edge], b[edge]
        fraction = (center[cut] - a[:, 1]) / (b[:, 1] - a[:, 1])
        point = a[:, ::2] + fraction[:, None] * (b[:, ::2] - a[:, ::2])
        farther = point[:, 0] < left[cut, 0]
        left[cut[farther]] = point[farther]
        farther = point[:, 0] > right[cut, 0]
        right[cut[farther]] = point[farther]
    return owner, row, left, right
