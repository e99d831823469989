"""Light, outlines and smooth normals in pictures of solids."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges

MATERIAL: Final = np.array([0.94, 0.88, 0.76], dtype=np.float32)
"""Colour of a die under full light."""

LINE: Final = np.array([0.20, 0.18, 0.16], dtype=np.float32)
"""Colour of outlines."""

SAMPLES: Final = 2
"""Samples along a side of each pixel."""

_LIGHT: Final = np.array([-0.40, 0.55, 0.73])

_AMBIENT: Final = 0.38

_STEP_PIXELS: Final = 2.0

_RECESS_SHADE: Final = 0.45

_SMOOTH_DEGREES: Final = 35.0


def brightness(normals: Floats) -> Floats:
    """(...) share of the material's colour that surfaces of unit normals (..., 3) show, with x to
    the right, y up and z to the camera; the light comes from the upper left."""
    return _AMBIENT + (1.0 - _AMBIENT) * (normals @ _LIGHT).clip(0.0)


def sample_means(samples: NDArray[Any]) -> Floats:
    """(h, w, ...) of (h `SAMPLES`, w `SAMPLES`, ...): the mean of the samples of each pixel."""
    rows = samples[::SAMPLES] * 1.0
    for k in range(1, SAMPLES):
        rows += samples[k::SAMPLES]
    pixels = rows[:, ::SAMPLES].copy()
    for k in range(1, SAMPLES):
        pixels += rows[:, k::SAMPLES]
    return np.asarray(pixels / SAMPLES**2)


def facing_normals(corners: Floats) -> Floats:
    """Unit normals (t, 3), turned to the camera, with x to the right, y up and z to the camera.

    Triangles without area have the normal 0; no pixel sees them.
    """
    corners = corners * np.array([1.0, -1.0, 1.0])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= np.where(normals[:, 2] < 0.0, -1.0, 1.0)[:, None]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)


def blurred(pixels: Floats, reach: float) -> Floats:
    """Pixels (h, w), beyond which all is 0, blurred almost as by a Gaussian.

    reach: standard deviation in pixels, above 0. Three means over as many pixels have it.
    """
    half = max(round((np.sqrt(4.0 * reach**2 + 1.0) - 1.0) / 2.0), 1)
    width = 2 * half + 1
    for _ in range(3):
        for axis in range(2):
            borders = [(half + 1, half) if axis == k else (0, 0) for k in range(2)]
            sums = np.pad(pixels, borders).cumsum(axis=axis)
            last, first = (
                (sums[width:], sums[:-width]) if axis == 0 else (sums[:, width:], sums[:, :-width])
            )
            pixels = (last - first) / width
    return pixels


def recess_shade(coverage: Floats, height: Floats, reach: float) -> Floats:
    """Share of their light that pixels (h, w) keep, less the farther they lie behind the mean of
    the surface around them.

    coverage: the share of each pixel that sees the surface; height: its mean depth in samples
    where the rest counts as 0; reach: of the surroundings, in pixels.
    """
    weight = blurred(coverage, reach)
    near = blurred(height, reach)
    here = np.divide(height, coverage, out=np.zeros_like(height), where=coverage > 0.0)
    behind = np.where(coverage > 0.0, near - here * weight, 0.0)
    return np.asarray(1.0 - _RECESS_SHADE * (behind / (SAMPLES * reach)).clip(0.0, 1.0))


def outline(seen: Integers, normals: Floats, depth: Floats, sharp_degrees: float) -> Booleans:
    """Samples (n * n,), row by row, on either side of a silhouette, of a sharp edge or of a step in
    depth.

    seen: (n, n) triangle of each sample, or -1; normals: (t, 3) of the triangles, toward the
    camera; depth: (n, n) toward the camera, in samples; sharp_degrees: angle between the normals at
    an edge beyond which it is sharp.
    """
    sharp_cosine = np.cos(np.radians(sharp_degrees))
    triangle, height = seen.ravel(), depth.ravel()
    line = np.zeros(triangle.shape, dtype=bool)
    for step, offset in ((1, (1.0, 0.0)), (len(seen), (0.0, -1.0))):
        # Within a triangle there is neither an edge nor a step.
        sample = np.flatnonzero(triangle[:-step] != triangle[step:])
        if step == 1:
            sample = sample[sample % len(seen) != len(seen) - 1]
        one, other = triangle[sample], triangle[sample + step]
        border = (one < 0) | (other < 0)
        both = np.flatnonzero(~border)
        first, second = normals[one[both]], normals[other[both]]
        # How far each of two neighbouring surface points lies from the other one's plane.
        rise = height[sample[both] + step] - height[sample[both]]
        from_one = np.abs(first[:, :2] @ offset + first[:, 2] * rise)
        from_other = np.abs(second[:, :2] @ offset + second[:, 2] * rise)
        sharp = (first * second).sum(-1) < sharp_cosine
        border[both] = sharp | (np.minimum(from_one, from_other) > _STEP_PIXELS)
        line[sample[border]] = True
        line[sample[border] + step] = True
    return line


def corner_normals(points: Floats, triangles: Integers) -> Floats:
    """(t, 3, 3) unit normals at the corners of triangles, to be interpolated within each.

    The normal at a corner is the mean, by area, of those of the triangles at its vertex that turn
    at most 35 degrees from the corner's own triangle: smooth parts are shaded smoothly, and sharp
    edges stay sharp. Those of triangles without area are 0.

    points: (n, 3) in any length unit; triangles: (t, 3), oriented alike.
    """
    corners = points[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(areas, axis=1, keepdims=True)
    flat = np.divide(areas, sizes, out=np.zeros_like(areas), where=sizes > 0.0)
    vertex = triangles.ravel()
    by_vertex = np.argsort(vertex, kind="stable")
    counts = np.bincount(vertex, minlength=len(points))
    starts = np.cumsum(counts) - counts
    # Each corner with each corner at the same vertex.
    corner, place = ragged_ranges(starts[vertex], counts[vertex])
    triangle, other = corner // 3, by_vertex[place] // 3
    smooth = (flat[triangle] * flat[other]).sum(-1) >= np.cos(np.radians(_SMOOTH_DEGREES))
    corner, other = corner[smooth], other[smooth]
    sums = np.stack(
        [np.bincount(corner, areas[other, k], minlength=len(vertex)) for k in range(3)], axis=1
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    normals = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0.0)
    return normals.reshape(-1, 3, 3)
