"""Pictures, orthographic cameras, and the triangle that a camera sees in each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers, ragged_ranges

Picture: TypeAlias = NDArray[np.uint8]
"""(h, w, 3) red, green and blue, or (h, w, 4) with opacity."""

UPRIGHT = (".stl", ".3mf", ".xyz")
"""Endings of files for printing and construction, in which z is upward; in other files y is."""

UP = np.array([0.0, 0.0, 1.0])

TURNS_DEG = (35.0, 155.0, 275.0)
"""Angles of three cameras around a body, from its front to the right."""

MARGIN = 1.08
"""Width of a picture over the width of the body."""

WEBP_QUALITY = 84
"""Quality of pictures in pages, of 100."""


def encode_png(picture: Picture) -> bytes:
    """Content of the PNG file of a picture."""
    buffer = BytesIO()
    Image.fromarray(picture).save(buffer, "PNG", compress_level=1)
    return buffer.getvalue()


def encode_webp(picture: Picture, max_width: int | None = None) -> bytes:
    """Content of the WebP file of a picture, scaled down to at most `max_width` pixels."""
    buffer, image = BytesIO(), Image.fromarray(picture)
    if max_width is not None:
        image.thumbnail((max_width, image.height))
    image.save(buffer, "WEBP", quality=WEBP_QUALITY, method=4)
    return buffer.getvalue()


def decode_png(png: bytes) -> Picture:
    """Picture of a PNG file."""
    return np.asarray(Image.open(BytesIO(png)).convert("RGB"))


def trim(pictures: Sequence[Picture]) -> list[Picture]:
    """Cut rows above and below that are white in all pictures (h, w, 3) of one size, except 8."""
    used = np.flatnonzero((np.stack(pictures) < 255).any(axis=(0, 2, 3)))
    if len(used) == 0:
        return list(pictures)
    return [picture[max(used[0] - 8, 0) : used[-1] + 9] for picture in pictures]


@dataclass(frozen=True, eq=False)
class Camera:
    """Orthographic camera with a square picture.

    Attributes
    ----------
    direction: (3,) direction from the body to the camera, of any length above 0.
    up: (3,) direction that is upward in the picture; not parallel to `direction`.
    center: (3,) point in the middle of the picture.
    half_width: half the side of the picture, in the body's length unit, above 0.
    """

    direction: Floats
    up: Floats
    center: Floats = field(default_factory=lambda: np.zeros(3))
    half_width: float = 1.0

    def frame(self) -> Floats:
        """(3, 3) unit directions: right, up and toward the camera."""
        right = np.cross(self.up, self.direction)
        axes = np.stack([right, np.cross(self.direction, right), self.direction])
        return unit_vectors(axes)

    def pixel_positions(self, vertices: Floats, size: int) -> Floats:
        """Column, row from the top and depth toward the camera (n, 3) of vertices (n, 3), in pixels
        of a picture of `size` pixels along each side."""
        scale = size / (2.0 * self.half_width)
        positions = (vertices - self.center) @ self.frame().T * scale
        return positions * np.array([1.0, -1.0, 1.0]) + np.array([size / 2.0, size / 2.0, 0.0])


def tilt_up(level: Floats, up: Floats, degrees: float = 18.0) -> Floats:
    """Horizontal unit direction (3,), turned upward by an angle; up: (3,) unit vector."""
    rise = np.radians(degrees)
    return np.asarray(np.cos(rise) * level + np.sin(rise) * up)


def three_cameras(points: Floats, up: Floats) -> list[Camera]:
    """Cameras around points, 120 degrees apart and slightly above them, all at one scale.

    points: (n, 3) in any length unit, all in the pictures; up: (3,) direction that is upward in the
    pictures, of any length above 0. The front of the body is +z if y is upward and -y if z is.
    """
    upward = up / norms(up)
    right = np.eye(3)[int(abs(upward[0]) > np.sqrt(0.5))]
    right = unit_vectors(right - (right @ upward) * upward)
    front = np.cross(right, upward)
    levels = [np.cos(turn) * front + np.sin(turn) * right for turn in np.radians(TURNS_DEG)]
    cameras = [Camera(tilt_up(level, upward, 15.0), upward) for level in levels]
    return frame_cameras(cameras, [points] * len(cameras))


def upward_of(path: Path | str | None) -> Floats:
    """Direction (3,) that is upward in a mesh file, by its ending; z for a body without one."""
    return UP if path is None or Path(path).suffix.lower() in UPRIGHT else np.array([0.0, 1.0, 0.0])


def frame_cameras(cameras: Sequence[Camera], points: Sequence[Floats]) -> list[Camera]:
    """Move cameras, and set one scale for all, so that each has its points (n, 3) in the middle of
    its picture, and none outside."""
    moved, half_widths = [], []
    for camera, visible_points in zip(cameras, points, strict=True):
        places = visible_points @ camera.frame().T
        low, high = places.min(axis=0), places.max(axis=0)
        moved.append(replace(camera, center=(low + high) / 2.0 @ camera.frame()))
        half_widths.append(float((high - low)[:2].max()) / 2.0)
    return [replace(camera, half_width=MARGIN * max(half_widths)) for camera in moved]


def rasterize(positions: Floats, triangles: Integers, size: int) -> tuple[Integers, Floats]:
    """Nearest triangle at each pixel, by a depth buffer.

    A pixel sees a triangle that contains its center, from either side. Triangles with a common edge
    leave no gap.

    Parameters
    ----------
    positions: (n, 3) column, row and depth in pixels; greater depths are nearer.
    triangles: (t, 3) indices of positions.
    size: pixels along each side.

    Returns
    -------
    (size, size) triangle at each pixel, or -1; (size, size) depth at each pixel, or -inf.
    """
    picture = kernels.rasterize(positions, triangles, size)
    if picture is not None:
        return picture
    owner, row, left, right = _spans(positions[triangles], size)
    first = np.ceil(left[:, 0] - 0.5).clip(0, size).astype(np.int64)
    count = (np.ceil(right[:, 0] - 0.5).clip(0, size).astype(np.int64) - first).clip(0)
    span, column = ragged_ranges(first, count)
    # Spans that contain the center of a pixel have a width above 0.
    slope = np.zeros(len(owner))
    np.divide(right[:, 1] - left[:, 1], right[:, 0] - left[:, 0], out=slope, where=count > 0)
    depth = column + 0.5
    depth -= left[:, 0].repeat(count)
    depth *= slope.repeat(count)
    depth += left[:, 1].repeat(count)
    pixel = (row * size).repeat(count) + column
    nearest = np.full(size * size, -np.inf)
    np.maximum.at(nearest, pixel, depth)
    nearest_triangles = np.full(size * size, -1, dtype=np.int64)
    front = depth == nearest[pixel]
    nearest_triangles[pixel[front]] = owner[span[front]]
    return nearest_triangles.reshape(size, size), nearest.reshape(size, size)


def _spans(corners: Floats, size: int) -> tuple[Integers, Integers, Floats, Floats]:
    """Spans of triangles (t, 3, 3) on the center lines of pixel rows.

    Returns the triangle (s,), the row (s,), and the left and right end (s, 2) of each span, by
    column and depth.
    """
    rows = corners[:, :, 1]
    first = np.ceil(rows.min(axis=1) - 0.5).clip(0, size).astype(np.int64)
    count = (np.ceil(rows.max(axis=1) - 0.5).clip(0, size).astype(np.int64) - first).clip(0)
    owner, row = ragged_ranges(first, count)
    center = row + 0.5
    left, right = np.full((len(owner), 2), np.inf), np.full((len(owner), 2), -np.inf)
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        # Both triangles at an edge compute identical crossings if both start at its upper end.
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
