"""Pictures of a solid: flat shading, outlined edges, a depth buffer."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.report.render.raster import Camera, rasterize
from dicedesign.report.render.shading import (
    LINE,
    MATERIAL,
    SAMPLES,
    brightness,
    facing_normals,
    outline,
    recess_shade,
    sample_means,
)
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["render_view"]

_SHARP_DEGREES: Final = 20.0


def render_view(
    vertices: Floats,
    triangles: Integers,
    camera: Camera,
    size: int,
    backdrop: Floats | None = None,
) -> NDArray[np.uint8]:
    """Picture of a triangle mesh, lit from the upper left.

    Edges sharper than 20 degrees, steps and silhouettes are drawn dark, and recesses darker than
    their surroundings.

    Parameters
    ----------
    vertices: (n, 3) in any length unit.
    triangles: (t, 3) indices of vertices; both sides are drawn alike.
    camera: where to look from.
    size: pixels a side, above 0.
    backdrop: (size, size) brightness from 0 to 1 of the paper behind, or None for white.

    Returns
    -------
    (size, size, 3) uint8.
    """
    fine = SAMPLES * size
    positions = camera.pixel_positions(vertices, fine)
    seen, depth = rasterize(positions, triangles, fine)
    normals = facing_normals(positions[triangles])
    covered = seen >= 0
    line = outline(seen, normals, depth, _SHARP_DEGREES)
    shade = sample_means(np.where(covered & ~line, brightness(normals)[seen], 0.0))
    coverage = sample_means(covered)
    height = sample_means(np.where(covered, depth, 0.0))
    shade *= recess_shade(coverage, height)
    lines = sample_means(line)
    paper = 1.0 - sample_means(covered | line)
    if backdrop is not None:
        paper *= backdrop
    colors = shade[..., None] * MATERIAL + lines[..., None] * LINE + paper[..., None]
    return np.rint(255.0 * colors).astype(np.uint8)
