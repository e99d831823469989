"""Pictures of a solid: flat shading, outlined edges, a depth buffer."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from dicedesign.show.raster import Camera, rasterize

__all__ = ["render_view"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_LIGHT: Final = np.array([-0.40, 0.55, 0.73])
_MATERIAL: Final = np.array([0.94, 0.88, 0.76])
_AMBIENT: Final = 0.38
_LINE: Final = np.array([0.20, 0.18, 0.16])
_SHARP_COSINE: Final = np.cos(np.radians(20.0))
_STEP_PIXELS: Final = 2.0
_SAMPLES: Final = 2
_RECESS_REACH: Final = 0.02
_RECESS_SHADE: Final = 0.45


def render_view(
    vertices: Floats, triangles: Integers, camera: Camera, size: int
) -> NDArray[np.uint8]:
    """Picture of a triangle mesh on white, lit from the upper left.

    Edges sharper than 20 degrees, steps and silhouettes are drawn dark, and recesses darker than
    their surroundings.

    Parameters
    ----------
    vertices: (n, 3) in any length unit.
    triangles: (t, 3) indices of vertices; both sides are drawn alike.
    camera: where to look from.
    size: pixels a side, above 0.

    Returns
    -------
    (size, size, 3) uint8.
    """
    fine = _SAMPLES * size
    positions = camera.pixel_positions(vertices, fine)
    seen, depth = rasterize(positions, triangles, fine)
    normals = _facing_normals(positions[triangles])
    covered = seen >= 0
    line = _outline(seen, normals, depth)
    shade = (_AMBIENT + (1.0 - _AMBIENT) * (normals @ _LIGHT).clip(0.0))[seen]
    shade = _sample_means(np.where(covered & ~line, shade, 0.0))
    coverage = _sample_means(covered)
    height = _sample_means(np.where(covered, depth, 0.0))
    shade *= 1.0 - _RECESS_SHADE * _recess(coverage, height)
    lines = _sample_means(line)
    white = 1.0 - _sample_means(covered | line)
    colors = shade[..., None] * _MATERIAL + lines[..., None] * _LINE + white[..., None]
    return np.rint(255.0 * colors).astype(np.uint8)


def _sample_means(samples: NDArray[Any]) -> Floats:
    """(h, w) of (h `_SAMPLES`, w `_SAMPLES`): the mean of the samples of each pixel."""
    steps = range(_SAMPLES)
    total = sum(samples[i::_SAMPLES, j::_SAMPLES].astype(np.float64) for i in steps for j in steps)
    return np.asarray(total) / _SAMPLES**2


def _facing_normals(corners: Floats) -> Floats:
    """Unit normals (t, 3), turned to the camera, with x to the right, y up and z to the camera.

    Triangles without area have the normal 0; no pixel sees them.
    """
    corners = corners * np.array([1.0, -1.0, 1.0])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= np.where(normals[:, 2] < 0.0, -1.0, 1.0)[:, None]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)


def _recess(coverage: Floats, height: Floats) -> Floats:
    """How far pixels (h, w) lie behind the mean of the surface around them, from 0 to 1.

    coverage: the share of each pixel that sees the surface; height: its mean depth in samples
    where the rest counts as 0.
    """
    reach = _RECESS_REACH * len(height)
    weight = gaussian_filter(coverage, reach)
    near = gaussian_filter(height, reach)
    here = np.divide(height, coverage, out=np.zeros_like(height), where=coverage > 0.0)
    behind = np.where(coverage > 0.0, near - here * weight, 0.0)
    return (behind / (_SAMPLES * reach)).clip(0.0, 1.0)


def _outline(seen: Integers, normals: Floats, depth: Floats) -> NDArray[np.bool_]:
    """Samples (h, w) on either side of a silhouette, of a sharp edge or of a step in depth.

    seen: (h, w) triangle of each sample, or -1; normals: (t, 3) of the triangles.
    """
    line = np.zeros(seen.shape, dtype=bool)
    ahead, behind = slice(1, None), slice(None, -1)
    for a, b, offset in (
        ((slice(None), behind), (slice(None), ahead), np.array([1.0, 0.0])),
        ((behind, slice(None)), (ahead, slice(None)), np.array([0.0, -1.0])),
    ):
        # Within a triangle there is neither an edge nor a step.
        change = seen[a] != seen[b]
        one, other = seen[a][change], seen[b][change]
        both = (one >= 0) & (other >= 0)
        border = ~both
        one, other = normals[one[both]], normals[other[both]]
        # How far each of two neighbouring surface points lies from the other one's plane.
        rise = depth[b][change][both] - depth[a][change][both]
        from_one = np.abs(one[:, :2] @ offset + one[:, 2] * rise)
        from_other = np.abs(other[:, :2] @ offset + other[:, 2] * rise)
        sharp = (one * other).sum(-1) < _SHARP_COSINE
        border[both] = sharp | (np.minimum(from_one, from_other) > _STEP_PIXELS)
        line[a][change] |= border
        line[b][change] |= border
    return line
