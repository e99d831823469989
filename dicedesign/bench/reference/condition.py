"""How much a body's probabilities magnify a rounding of its coordinates.

How the flow lines of a body cross the arcs of its edges."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.rest.morse import Separatrices, separatrix_points, signed_areas
from dicedesign.runtime.arrays import Floats

__all__ = ["condition", "smallest_growth_and_slant"]

STEP: Final = 1e-13
"""Relative size of the perturbations."""

TRIALS: Final = 3

REFERENCE: Final = np.array([0.48, 0.31, -0.82])
"""A direction from which areas are measured; any will do whose opposite is on no border."""


def condition(hull: ConvexHull, center: Floats, paths: Separatrices) -> float:
    """Largest change of a probability over the relative size of the change of coordinates.

    Every corner is moved by `STEP` times its distance from the center of mass, in random directions
    along the axes, while all decisions (which edges a path crosses, which facets are rests) are
    kept: an estimate from below of the condition number of what is computed after them.

    hull: the convex hull; center: (3,) strictly inside; paths: its separatrices.
    """
    if len(paths.saddles) == 0:
        return 0.0
    rng = np.random.default_rng(0)
    radii = hull.vertices - center
    size = STEP * norms(radii)[:, None]
    before = _areas(radii, paths)
    largest = 0.0
    for _ in range(TRIALS):
        moved = radii + size * rng.choice([-1.0, 1.0], size=radii.shape)
        change = (_areas(moved, paths) - before) / (4.0 * np.pi)
        largest = max(largest, float(np.abs(change - np.round(change)).max()) / STEP)
    return largest


def _areas(radii: Floats, paths: Separatrices) -> Floats:
    """Areas (k,) of the basins, up to multiples of 4 pi; radii (n, 3): corners from the center."""
    points = separatrix_points(paths, radii, np.zeros(3), np)
    return signed_areas(paths, points, np.tile(REFERENCE, (len(paths.rests), 1)))


def smallest_growth_and_slant(
    paths: Separatrices, vertices: Floats, center: Floats
) -> tuple[float, float]:
    """Two sines, the smallest over all crossings; 1 and 1 where no arc is crossed.

    The first is r_p . v / (|r_p| |v|), how fast distance from the center of mass grows along the
    crossed edge. The second is the slant, the sine of the angle between a flow line and the arc
    that it crosses: the first over the sine of the angle from the crossing to r_p.

    vertices: (n, 3); center: (3,).
    """
    points = separatrix_points(paths, vertices, center, np)
    radii = vertices - center
    growth, slant = 1.0, 1.0
    for step in range(paths.crossed.shape[1]):
        crossing = paths.lengths > step
        p, q = paths.crossed[crossing, step].T
        r, v, u = radii[p], vertices[q] - vertices[p], points[crossing, step + 1]
        sine = (r * v).sum(-1) / (norms(r) * norms(v))
        apart = norms(np.linalg.cross(u, r)) / (norms(u) * norms(r))
        growth = min(growth, float(sine.min()))
        slant = min(slant, float((sine / np.maximum(apart, sine)).min()))
    return growth, slant
