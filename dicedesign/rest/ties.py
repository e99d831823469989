"""In which directions the center of mass of a body that balances is moved aside."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.runtime.arrays import Floats

__all__ = ["aside_directions"]

MIXTURE: Final = (0.73, 0.41, 0.58, -0.36)
"""How much of a flag's directions makes one: from the center of mass to the corner, along the edge,
from the edge into the facet, and the facet's normal. It lies in no plane that an edge or a symmetry
is likely to have."""

MOST_FLAGS: Final = 64
"""A body with more equivalent flags than this is moved to two sides only."""

SAME: Final = 9
"""Decimal digits to which lengths are compared that tell flags apart."""


def aside_directions(hull: ConvexHull, center: Floats) -> Floats:
    """Directions (2 k, 3), unit vectors in opposite pairs, that a symmetry of the body permutes.

    A flag is a corner with an edge at it and a facet beside that edge. Flags that a symmetry maps
    to each other have the same distances and areas; those with the rarest such set of numbers give
    one direction each. A body without symmetry is moved along one line, a regular pyramid along as
    many as it has symmetries. Where there are more than `MOST_FLAGS`, the first stands for all.

    center: (3,) inside.
    """
    radii = hull.vertices - center
    scale = float(norms(radii).max())
    corner = np.concatenate([hull.tail, hull.head])
    other = np.concatenate([hull.head, hull.tail])
    facet = np.tile(hull.facet, 2)
    beyond = np.tile(hull.facet[hull.twin], 2)
    distance, heights = norms(radii) / scale, hull.heights(center) / scale
    middle = (radii[corner] + radii[other]) / (2.0 * scale)
    keys = np.column_stack(
        [
            distance[corner],
            distance[other],
            norms(middle),
            heights[facet],
            heights[beyond],
            hull.areas[facet] / scale**2,
            hull.areas[beyond] / scale**2,
        ]
    )
    _, member, count = np.unique(keys.round(SAME), axis=0, return_inverse=True, return_counts=True)
    flags = np.flatnonzero(member == np.argmin(count))
    flags = flags[:1] if len(flags) > MOST_FLAGS else flags
    along_edge = unit_vectors(hull.vertices[other[flags]] - hull.vertices[corner[flags]])
    normal = hull.normals[facet[flags]]
    # Counter-clockwise around the facet its inside is to the left, and the other way to the right.
    left = np.where(flags < len(hull.tail), 1.0, -1.0)[:, None]
    parts = (
        radii[corner[flags]] / scale,
        along_edge,
        left * np.linalg.cross(normal, along_edge),
        normal,
    )
    mixed = sum(weight * part for weight, part in zip(MIXTURE, parts, strict=True))
    along = unit_vectors(mixed)
    return np.stack([along, -along], axis=1).reshape(-1, 3)
