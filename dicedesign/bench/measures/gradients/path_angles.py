"""How the flow lines of a body cross the arcs of its edges. It describes bodies; nothing is judged
by it."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.sphere import norms
from dicedesign.rest.morse import Separatrices, separatrix_points
from dicedesign.runtime.arrays import Floats

__all__ = ["smallest_growth_and_slant"]


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
