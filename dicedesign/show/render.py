"""Pictures of a solid: flat shading, outlined edges, a depth buffer."""

from __future__ import annotations

from typing import Final

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
    covered = seen >= 0
    normals = _facing_normals(positions[triangles])[np.where(covered, seen, 0)]
    shade = _AMBIENT + (1.0 - _AMBIENT) * (normals @ _LIGHT).clip(0.0)
    shade *= 1.0 - _RECESS_SHADE * _recess(covered, depth)
    colors = np.where(covered[..., None], shade[..., None] * _MATERIAL, 1.0)
    colors[_outline(covered, normals, depth)] = _LINE
    mean = colors.reshape(size, _SAMPLES, size, _SAMPLES, 3).mean(axis=(1, 3))
    return np.rint(255.0 * mean).astype(np.uint8)


def _facing_normals(corners: Floats) -> Floats:
    """Unit normals (t, 3), turned to the camera, with x to the right, y up and z to the camera.

    Triangles without area have the normal 0; no pixel sees them.
    """
    corners = corners * np.array([1.0, -1.0, 1.0])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= np.where(normals[:, 2] < 0.0, -1.0, 1.0)[:, None]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)


def _recess(covered: NDArray[np.bool_], depth: Floats) -> Floats:
    """How far pixels (h, w) lie behind the mean of the surface around them, from 0 to 1."""
    reach = _RECESS_REACH * len(depth)
    weight = gaussian_filter(covered.astype(np.float64), reach)
    height = np.where(covered, depth, 0.0)
    near = gaussian_filter(height, reach)
    behind = np.where(covered, near - height * weight, 0.0)
    return (behind / reach).clip(0.0, 1.0)


def _outline(covered: NDArray[np.bool_], normals: Floats, depth: Floats) -> NDArray[np.bool_]:
    """Pixels (h, w) on either side of a silhouette, of a sharp edge or of a step in depth."""
    line = np.zeros(covered.shape, dtype=bool)
    ahead, behind = slice(1, None), slice(None, -1)
    for a, b, offset in (
        ((slice(None), behind), (slice(None), ahead), np.array([1.0, 0.0])),
        ((behind, slice(None)), (ahead, slice(None)), np.array([0.0, -1.0])),
    ):
        both = covered[a] & covered[b]
        # How far each of two neighbouring surface points lies from the other one's plane.
        rise = np.where(both, depth[b], 0.0) - np.where(both, depth[a], 0.0)
        from_a = np.abs(normals[a][..., :2] @ offset + normals[a][..., 2] * rise)
        from_b = np.abs(normals[b][..., :2] @ offset + normals[b][..., 2] * rise)
        sharp = (normals[a] * normals[b]).sum(-1) < _SHARP_COSINE
        step = np.minimum(from_a, from_b) > _STEP_PIXELS
        border = (covered[a] != covered[b]) | (both & (sharp | step))
        line[a] |= border
        line[b] |= border
    return line
